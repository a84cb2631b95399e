// `node node_clients.mjs CLIENT URL KEY PICTURE`: as python_clients.py, with npm's clients.
import { createOpenAICompatible } from "@ai-sdk/openai-compatible";
import { generateObject, generateText, stepCountIs, streamText, tool } from "ai";
import OpenAI from "openai";
import { zodResponseFormat } from "openai/helpers/zod";
import { z } from "zod";

const [client, url, key, picture] = process.argv.slice(2);
const MODEL = "maker/model";
const HELLO = [{ role: "user", content: "hello" }];
const SUM = [{ role: "user", content: "what is 6 times 7?" }];
const Reading = z.object({ floor: z.number(), object: z.string() });

async function withOpenAI() {
  const openai = new OpenAI({ baseURL: url, apiKey: key, maxRetries: 0 });
  const chat = openai.chat.completions;
  const text = async (more) => (await chat.create({ model: MODEL, messages: HELLO, ...more })).choices[0].message.content;
  const parameters = { type: "object", properties: { a: { type: "integer" }, b: { type: "integer" } }, required: ["a", "b"] };
  const tools = [{ type: "function", function: { name: "product", parameters } }];
  const first = (await chat.create({ model: MODEL, messages: SUM, tools })).choices[0].message;
  const result = { role: "tool", tool_call_id: first.tool_calls[0].id, content: "42" };
  let streamed = "";
  for await (const piece of await chat.create({ model: MODEL, messages: HELLO, stream: true }))
    streamed += piece.choices[0]?.delta.content ?? "";
  let begun = 0;
  const endless = await chat.create({ model: MODEL, messages: [{ role: "user", content: "count for ever" }], stream: true });
  for await (const _ of endless) if (++begun === 3) break;
  const image = { type: "image_url", image_url: { url: picture } };
  const models = [];
  for await (const model of openai.models.list()) models.push(model.id);
  const parsed = await chat.parse({ model: MODEL, messages: HELLO, response_format: zodResponseFormat(Reading, "reading") });
  const missing = await chat.create({ model: "nobody", messages: HELLO }).catch((error) => error.code);
  return {
    chat: await text({}),
    picture: await text({ messages: [{ role: "user", content: [{ type: "text", text: "what is it?" }, image] }] }),
    stream: streamed,
    tools: await text({ messages: [...SUM, first, result], tools }),
    structured: parsed.choices[0].message.parsed,
    models,
    missing,
    begun,
  };
}

async function withAiSdk() {
  const provider = createOpenAICompatible({ name: "gateway", baseURL: url, apiKey: key, supportsStructuredOutputs: true });
  const model = provider(MODEL);
  const inputSchema = z.object({ a: z.number(), b: z.number() });
  const product = tool({ description: "of two numbers", inputSchema, execute: async ({ a, b }) => a * b });
  const text = async (more) => (await generateText({ model, maxRetries: 0, ...more })).text;
  let streamed = "";
  for await (const piece of streamText({ model, prompt: "hello" }).textStream) streamed += piece;
  let begun = 0;
  const stop = new AbortController();
  for await (const _ of streamText({ model, prompt: "count for ever", abortSignal: stop.signal }).textStream)
    if (++begun === 3) {
      stop.abort();
      break;
    }
  const content = [{ type: "text", text: "what is it?" }, { type: "image", image: picture }];
  return {
    chat: await text({ prompt: "hello" }),
    picture: await text({ messages: [{ role: "user", content }] }),
    stream: streamed,
    tools: await text({ prompt: "what is 6 times 7?", tools: { product }, stopWhen: stepCountIs(3) }),
    structured: (await generateObject({ model, schema: Reading, prompt: "hello" })).object,
    begun,
  };
}

const result = await { openai: withOpenAI, ai: withAiSdk }[client]();
console.log("\nRESULT " + JSON.stringify(result));
process.exit(0);
