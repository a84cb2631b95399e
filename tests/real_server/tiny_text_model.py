"""Writes a tiny llama with random weights as a GGUF file, its vocabulary the printable characters.

    python tiny_text_model.py FILE [SEED]

Runs with the Python of the llama server's own environment. Nothing is downloaded.
"""

import sys

import gguf
import numpy as np

CONTEXT, WIDTH, LAYERS, HEADS, INNER = 8192, 64, 2, 4, 96


def main() -> None:
    path = sys.argv[1]
    chance = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    characters = [chr(code) for code in range(33, 127)]
    tokens = ["<unk>", "<s>", "</s>", *(f"<0x{byte:02X}>" for byte in range(256)), "▁", *characters]
    kinds = [gguf.TokenType.UNKNOWN, gguf.TokenType.CONTROL, gguf.TokenType.CONTROL]
    kinds += [gguf.TokenType.BYTE] * 256 + [gguf.TokenType.NORMAL] * (len(characters) + 1)
    writer = gguf.GGUFWriter(path, "llama")
    writer.add_name("tiny random llama")
    writer.add_context_length(CONTEXT)
    writer.add_embedding_length(WIDTH)
    writer.add_block_count(LAYERS)
    writer.add_feed_forward_length(INNER)
    writer.add_head_count(HEADS)
    writer.add_head_count_kv(HEADS)
    writer.add_rope_dimension_count(WIDTH // HEADS)
    writer.add_layer_norm_rms_eps(1e-5)
    writer.add_vocab_size(len(tokens))
    writer.add_tokenizer_model("llama")
    writer.add_token_list(tokens)
    writer.add_token_scores([0.0] * len(tokens))
    writer.add_token_types(kinds)
    writer.add_bos_token_id(1)
    writer.add_eos_token_id(2)
    writer.add_unk_token_id(0)

    def noise(*shape: int) -> "np.ndarray[tuple[int, ...], np.dtype[np.float32]]":
        return (chance.standard_normal(shape) * 0.5).astype(np.float32)

    flat = np.ones(WIDTH, np.float32)
    writer.add_tensor("token_embd.weight", noise(len(tokens), WIDTH))
    for layer in range(LAYERS):
        block = f"blk.{layer}."
        writer.add_tensor(block + "attn_norm.weight", flat)
        for name in ("attn_q", "attn_k", "attn_v", "attn_output"):
            writer.add_tensor(f"{block}{name}.weight", noise(WIDTH, WIDTH))
        writer.add_tensor(block + "ffn_norm.weight", flat)
        writer.add_tensor(block + "ffn_gate.weight", noise(INNER, WIDTH))
        writer.add_tensor(block + "ffn_up.weight", noise(INNER, WIDTH))
        writer.add_tensor(block + "ffn_down.weight", noise(WIDTH, INNER))
    writer.add_tensor("output_norm.weight", flat)
    writer.add_tensor("output.weight", noise(len(tokens), WIDTH))
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()


if __name__ == "__main__":
    main()
