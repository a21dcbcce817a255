// What page and server say to each other, held against viewer/api/openapi.json: nothing less than it promises, and nothing that it does not name.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { Ajv2020, type ValidateFunction } from 'ajv/dist/2020.js';
import formats from 'ajv-formats';
import type { Page, Request, Response } from 'playwright-core';

type Json = null | boolean | number | string | Json[] | { [key: string]: Json };
type Fields = { [key: string]: Json };
const isFields = (value: Json | undefined): value is Fields => typeof value === 'object' && value !== null && !Array.isArray(value);
const field = (value: Json | undefined, ...path: string[]): Json | undefined =>
  path.reduce<Json | undefined>((inner, key) => (isFields(inner) ? inner[key] : undefined), value);

const kSchemas = '#/components/schemas/';

/**
 * The document with schemas that refuse fields which they do not name, unless "x-open" says that there are more. Where a schema is used it is closed, not where
 * it is defined: parts of an allOf name a part of the fields each.
 */
function closed(document: Json): Json {
  const names = (schema: Fields): boolean => {
    const target = schema['$ref'];
    if (typeof target === 'string') {
      return target.startsWith(kSchemas) && field(document, 'components', 'schemas', target.slice(kSchemas.length), 'x-open') !== true;
    }
    return (isFields(schema['properties']) || Array.isArray(schema['allOf'])) && schema['x-open'] !== true;
  };
  const close = (value: Json, whole: boolean, isMap = false): Json => {
    if (Array.isArray(value)) return value.map((one) => close(one, whole));
    if (!isFields(value)) return value;
    const inner = Object.entries(value).map(([key, one]) => [key, close(one, !isMap && key !== 'allOf', key === 'schemas')] as const);
    return { ...Object.fromEntries(inner), ...(whole && !isMap && names(value) ? { unevaluatedProperties: false } : {}) };
  };
  return close(document, true);
}

const kDocument = 'openapi.json';
const pointer = (part: string) => part.replaceAll('~', '~0').replaceAll('/', '~1');

/** The routes of planning and training, which this document does not hold. */
const kElsewhere = /^\/(plan|planning|train|training)\b/;

export class Contract {
  /** A sentence for each body that is not as the document says. */
  readonly breaches: string[] = [];
  /** Bodies; none where nobody came. */
  checked = 0;
  visited = false;

  private readonly document: Json;
  private readonly ajv: Ajv2020;
  private readonly validators = new Map<string, ValidateFunction>();
  private readonly routes: { path: string; pattern: RegExp }[];
  private readonly pending = new Set<Promise<void>>();

  constructor(source: string) {
    this.document = closed(JSON.parse(readFileSync(join(source, 'viewer', 'api', 'openapi.json'), 'utf8')) as Json);
    this.ajv = new Ajv2020({ strict: false, allErrors: true, allowUnionTypes: true });
    formats(this.ajv, ['date-time']);
    // Of OpenAPI, and not checked here.
    for (const format of ['int64', 'byte', 'binary']) this.ajv.addFormat(format, true);
    this.ajv.addSchema(this.document as object, kDocument);
    const paths = field(this.document, 'paths');
    this.routes = Object.keys(isFields(paths) ? paths : {})
      // Whatever has fewer parameters is meant where both fit.
      .sort((a, b) => a.split('{').length - b.split('{').length)
      .map((path) => ({ path, pattern: new RegExp(`^${path.replace(/[.]/g, '\\.').replace(/\{\w+\}/g, '[^/]+')}$`) }));
  }

  listen(page: Page): void {
    this.visited = true;
    page.on('response', (response) => {
      const reading = this.hear(response).finally(() => this.pending.delete(reading));
      this.pending.add(reading);
    });
  }

  /** Waits for the bodies that are still being read. */
  async settle(): Promise<void> {
    await Promise.all(this.pending);
  }

  private async hear(response: Response): Promise<void> {
    const { pathname } = new URL(response.url());
    if (!pathname.startsWith('/api/')) return;
    const path = pathname.slice('/api'.length);
    if (kElsewhere.test(path)) return;
    const request = response.request();
    const method = request.method().toLowerCase();
    const route = this.routes.find(({ pattern }) => pattern.test(path))?.path;
    const told = `${request.method()} ${path} → ${response.status()}`;
    const operation = route === undefined ? undefined : field(this.document, 'paths', route, method);
    if (route === undefined || operation === undefined) {
      this.breaches.push(`${told}: no such operation`);
      return;
    }
    this.question(request, ['paths', route, method], operation, told);
    await this.answer(response, ['paths', route, method], operation, told);
  }

  private question(request: Request, at: string[], operation: Json, told: string): void {
    const body = request.postData();
    const schema = ['requestBody', 'content', 'application/json', 'schema'];
    if (body === null || body === '{}') return;
    if (field(operation, ...schema) === undefined) this.breaches.push(`${told}: takes no body, but got ${body.slice(0, 80)}`);
    else this.hold(JSON.parse(body) as Json, [...at, ...schema], `${told}: what was asked`);
  }

  private async answer(response: Response, at: string[], operation: Json, told: string): Promise<void> {
    const status = String(response.status());
    const which = field(operation, 'responses', status) !== undefined ? status : 'default';
    if (which === 'default' && response.ok()) {
      this.breaches.push(`${told}: this status is not named`);
      return;
    }
    const type = (response.headers()['content-type'] ?? '').split(';')[0] ?? '';
    let place = [...at, 'responses', which];
    const reference = field(this.document, ...place, '$ref');
    if (typeof reference === 'string') place = reference.slice('#/'.length).split('/');
    const content = field(this.document, ...place, 'content');
    if (type === '' && response.status() === 204) return;
    if (!isFields(content) || content[type] === undefined) {
      this.breaches.push(`${told}: ${type || 'no type'} is not named`);
      return;
    }
    if (type !== 'application/json' || field(content, type, 'schema') === undefined) return;
    let body: Json;
    try {
      body = (await response.json()) as Json;
    } catch {
      return; // The browser has let go of it: its page went elsewhere.
    }
    this.hold(body, [...place, 'content', type, 'schema'], told);
  }

  private hold(body: Json, place: string[], told: string): void {
    const at = `${kDocument}#/${place.map(pointer).join('/')}`;
    let validator = this.validators.get(at);
    if (!validator) this.validators.set(at, (validator = this.ajv.compile({ $ref: at })));
    ++this.checked;
    if (validator(body)) return;
    for (const { instancePath, message, params } of validator.errors ?? []) {
      const sentence = `${told}: ${instancePath || 'the body'} ${message ?? 'differs'} ${JSON.stringify(params)}`;
      if (!this.breaches.includes(sentence)) this.breaches.push(sentence);
    }
  }
}
