"""Run by another Python, which has the clients: `python python_clients.py CLIENT URL KEY PICTURE`. Prints as JSON
what the client got out of the gateway, by what was asked of it. Nothing here knows that it is no OpenAI."""

import asyncio
import json
import sys
from collections.abc import Callable
from typing import Any

MODEL = "maker/model"
HELLO = [{"role": "user", "content": "hello"}]
ENDLESS = [{"role": "user", "content": "count for ever"}]
SUM = [{"role": "user", "content": "what is 6 times 7?"}]
TOOL = {
    "type": "function",
    "function": {
        "name": "product",
        "description": "of two numbers",
        "parameters": {
            "type": "object",
            "properties": {"a": {"type": "integer"}, "b": {"type": "integer"}},
            "required": ["a", "b"],
        },
    },
}
SCHEMA = {
    "type": "object",
    "properties": {"floor": {"type": "integer"}, "object": {"type": "string"}},
    "required": ["floor", "object"],
    "additionalProperties": False,
}


def seeing(picture: str) -> list[dict[str, Any]]:
    image = {"type": "image_url", "image_url": {"url": picture}}
    return [{"role": "user", "content": [{"type": "text", "text": "what is it?"}, image]}]


def with_openai(url: str, key: str, picture: str) -> dict[str, Any]:
    import openai
    from pydantic import BaseModel

    class Reading(BaseModel):
        floor: int
        object: str

    client = openai.OpenAI(base_url=url, api_key=key, max_retries=0)
    chat = client.chat.completions
    first = chat.create(model=MODEL, messages=SUM, tools=[TOOL]).choices[0].message
    result = {"role": "tool", "tool_call_id": first.tool_calls[0].id, "content": "42"}
    second = chat.create(model=MODEL, messages=[*SUM, first, result], tools=[TOOL])
    stream = chat.create(model=MODEL, messages=HELLO, stream=True, stream_options={"include_usage": True})
    pieces = list(stream)
    endless = chat.create(model=MODEL, messages=ENDLESS, stream=True)
    begun = [next(endless) for _ in range(3)]
    endless.close()
    try:
        chat.create(model="nobody", messages=HELLO)
        missing = ""
    except openai.NotFoundError as error:
        missing = str(error.code)
    parsed = chat.parse(model=MODEL, messages=HELLO, response_format=Reading)
    return {
        "chat": chat.create(model=MODEL, messages=HELLO).choices[0].message.content,
        "picture": chat.create(model=MODEL, messages=seeing(picture)).choices[0].message.content,
        "stream": "".join(piece.choices[0].delta.content or "" for piece in pieces if piece.choices),
        "usage": pieces[-1].usage.completion_tokens,
        "tools": second.choices[0].message.content,
        "structured": parsed.choices[0].message.parsed.model_dump(),
        "models": [model.id for model in client.models.list()],
        "model": client.models.retrieve(MODEL).id,
        "missing": missing,
        "begun": len(begun),
    }


def with_litellm(url: str, key: str, picture: str) -> dict[str, Any]:
    import litellm

    def ask(messages: list[Any], **more: Any) -> Any:
        return litellm.completion(f"hosted_vllm/{MODEL}", messages=messages, api_base=url, api_key=key, **more)

    first = ask(SUM, tools=[TOOL]).choices[0].message
    result = {"role": "tool", "tool_call_id": first.tool_calls[0].id, "content": "42"}
    endless = ask(ENDLESS, stream=True)
    begun = [next(endless) for _ in range(3)]
    del endless
    form = {"type": "json_schema", "json_schema": {"name": "reading", "schema": SCHEMA, "strict": True}}
    return {
        "chat": ask(HELLO).choices[0].message.content,
        "picture": ask(seeing(picture)).choices[0].message.content,
        "stream": "".join(piece.choices[0].delta.content or "" for piece in ask(HELLO, stream=True)),
        "tools": ask([*SUM, first, result], tools=[TOOL]).choices[0].message.content,
        "structured": json.loads(ask(HELLO, response_format=form).choices[0].message.content),
        "begun": len(begun),
    }


def with_langchain(url: str, key: str, picture: str) -> dict[str, Any]:
    from langchain_core.messages import HumanMessage, ToolMessage
    from langchain_core.tools import tool
    from langchain_openai import ChatOpenAI

    @tool
    def product(a: int, b: int) -> int:
        """The product of two numbers."""
        return a * b

    model = ChatOpenAI(model=MODEL, base_url=url, api_key=key, max_retries=0)
    question = HumanMessage("what is 6 times 7?")
    calling = model.bind_tools([product])
    first = calling.invoke([question])
    result = ToolMessage(str(product.invoke(first.tool_calls[0]["args"])), tool_call_id=first.tool_calls[0]["id"])
    schema = {"title": "reading", **SCHEMA}

    async def cancelled() -> int:
        seen = 0
        async for _ in model.astream("count for ever"):
            seen += 1
            if seen == 3:
                break
        return seen

    return {
        "chat": model.invoke("hello").content,
        "picture": model.invoke([HumanMessage(seeing(picture)[0]["content"])]).content,
        "stream": "".join(str(piece.content) for piece in model.stream("hello")),
        "tools": calling.invoke([question, first, result]).content,
        "structured": model.with_structured_output(schema, method="json_schema").invoke("hello"),
        "begun": asyncio.run(cancelled()),
    }


def with_instructor(url: str, key: str, picture: str) -> dict[str, Any]:
    import instructor
    import openai
    from pydantic import BaseModel

    class Reading(BaseModel):
        floor: int
        object: str

    def reading(mode: instructor.Mode, messages: list[Any]) -> dict[str, Any]:
        client = instructor.from_openai(openai.OpenAI(base_url=url, api_key=key, max_retries=0), mode=mode)
        return client.chat.completions.create(model=MODEL, messages=messages, response_model=Reading).model_dump()

    return {
        "structured": reading(instructor.Mode.TOOLS, HELLO),
        "as_json": reading(instructor.Mode.JSON, HELLO),
        "of_a_picture": reading(instructor.Mode.TOOLS, seeing(picture)),
    }


def with_pydantic_ai(url: str, key: str, picture: str) -> dict[str, Any]:
    from pydantic import BaseModel
    from pydantic_ai import Agent, BinaryContent
    from pydantic_ai.models.openai import OpenAIChatModel
    from pydantic_ai.providers.openai import OpenAIProvider

    class Reading(BaseModel):
        floor: int
        object: str

    model = OpenAIChatModel(MODEL, provider=OpenAIProvider(base_url=url, api_key=key))
    talker = Agent(model)
    counter = Agent(model)

    @counter.tool_plain
    def product(a: int, b: int) -> int:
        """The product of two numbers."""
        return a * b

    async def streamed(question: str, pieces: int) -> list[str]:
        got: list[str] = []
        async with talker.run_stream(question) as run:
            async for piece in run.stream_text(delta=True, debounce_by=None):
                got.append(piece)
                if len(got) == pieces:
                    break
        return got

    import base64

    binary = BinaryContent(base64.b64decode(picture.partition(",")[2]), media_type="image/jpeg")
    return {
        "chat": talker.run_sync("hello").output,
        "picture": talker.run_sync(["what is it?", binary]).output,
        "stream": "".join(asyncio.run(streamed("hello", 100))),
        "tools": counter.run_sync("what is 6 times 7?").output,
        "structured": Agent(model, output_type=Reading).run_sync("hello").output.model_dump(),
        "begun": len(asyncio.run(streamed("count for ever", 3))),
    }


def with_anthropic(url: str, key: str, picture: str) -> dict[str, Any]:
    import anthropic

    client = anthropic.Anthropic(base_url=url.removesuffix("/v1"), api_key=key, max_retries=0)
    tool = {"name": "product", "description": "of two numbers", "input_schema": TOOL["function"]["parameters"]}
    source = {"type": "base64", "media_type": "image/jpeg", "data": picture.partition(",")[2]}
    seen = [{"type": "text", "text": "what is it?"}, {"type": "image", "source": source}]

    def ask(messages: list[Any], **more: Any) -> Any:
        return client.messages.create(model=MODEL, max_tokens=100, messages=messages, **more)

    first = ask(SUM, tools=[tool])
    used = next(block for block in first.content if block.type == "tool_use")
    assert (first.stop_reason, used.input) == ("tool_use", {"a": 6, "b": 7})
    result = {"type": "tool_result", "tool_use_id": used.id, "content": "42"}
    turns = [*SUM, {"role": "assistant", "content": first.content}, {"role": "user", "content": [result]}]
    with client.messages.stream(model=MODEL, max_tokens=100, messages=HELLO, system="Be kind.") as stream:
        streamed = "".join(stream.text_stream)
        final = stream.get_final_message()
    with client.messages.stream(model=MODEL, max_tokens=100, messages=SUM, tools=[tool]) as calling:
        called = calling.get_final_message()
    assert (called.stop_reason, called.content[-1].input) == ("tool_use", {"a": 6, "b": 7})
    with client.messages.stream(model=MODEL, max_tokens=100, messages=ENDLESS) as endless:
        words = iter(endless.text_stream)
        begun = [next(words) for _ in range(3)]
    try:
        client.messages.create(model="nobody", max_tokens=100, messages=HELLO)
        missing = ""
    except anthropic.NotFoundError as error:
        missing = str(error.body["error"]["code"])
    return {
        "chat": ask(HELLO).content[0].text,
        "picture": ask([{"role": "user", "content": seen}]).content[0].text,
        "stream": streamed,
        "usage": final.usage.output_tokens,
        "tools": ask(turns, tools=[tool]).content[0].text,
        "models": [model.id for model in client.models.list()],
        "missing": missing,
        "begun": len(begun),
    }


CLIENTS: dict[str, Callable[[str, str, str], dict[str, Any]]] = {
    "openai": with_openai,
    "litellm": with_litellm,
    "langchain-openai": with_langchain,
    "instructor": with_instructor,
    "pydantic-ai": with_pydantic_ai,
    "anthropic": with_anthropic,
}

if __name__ == "__main__":
    client, url, key, picture = sys.argv[1:]
    sys.stdout.write("\nRESULT " + json.dumps(CLIENTS[client](url, key, picture)) + "\n")
