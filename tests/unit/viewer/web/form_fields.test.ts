import { describe, expect, it } from 'vitest';
import { typed } from '@/base/form_fields';

describe('What was typed into a form', () => {
  const fields = new FormData();
  fields.set('name', ' Aoki ');
  fields.set('file', new Blob(['AGE-SECRET-KEY-1']), 'identity.txt');

  it('is the text of the field, as it was typed', () => {
    expect(typed(fields, 'name')).toBe(' Aoki ');
  });

  it('is nothing where the form has no such field, or it holds a file', () => {
    expect(typed(fields, 'user')).toBe('');
    expect(typed(fields, 'file')).toBe('');
  });
});
