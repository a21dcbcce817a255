// What a form holds.

/** What was typed into the field `name`; empty where the form has no such field, or it holds a file. */
export function typed(fields: FormData, name: string): string {
  const value = fields.get(name);
  return typeof value === 'string' ? value : '';
}
