import { readdirSync, readFileSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';

const folder = process.env['KIROKU_PAGE'];
if (!folder) throw new Error('KIROKU_PAGE names the folder of the built page');
const files = (readdirSync(folder, { recursive: true }) as string[]).filter((name) => statSync(join(folder, name)).isFile());

describe('The built page', () => {
  it('weighs 300 kB at most', () => {
    const compressed = files.filter((name) => name.endsWith('.gz'));
    expect(compressed.length).toBeGreaterThanOrEqual(3);
    expect(compressed.reduce((sum, name) => sum + statSync(join(folder, name)).size, 0)).toBeLessThanOrEqual(300_000);
  });
  it('has each of its files compressed beside it', () => {
    for (const name of files.filter((one) => !one.endsWith('.gz'))) expect(files).toContain(`${name}.gz`);
  });
  it('holds no script or style that a content security policy would forbid', () => {
    const html = readFileSync(join(folder, 'index.html'), 'utf8');
    expect(html).not.toMatch(/<script(?![^>]*\ssrc=)|<style|\sstyle=|\son[a-z]+=/);
    expect([...html.matchAll(/(?:src|href)="([^"]*)"/g)].map((one) => one[1])).toSatisfy((all: string[]) => all.every((one) => one.startsWith('/')));
  });
});
