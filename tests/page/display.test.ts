// The display of codes (`kiroku display`): dark but for the code, silent until somebody asks for its sound.
import type { Browser, BrowserContext, Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, it } from 'vitest';
import { Appliance, startBrowser, until } from './kit';

const kCodeBytes = 49 * 4608 * 2 + 44;

let appliance: Appliance;
let browser: Browser;
let context: BrowserContext;
let page: Page;
let url = '';
let recording: Promise<string>;
const problems: string[] = [];

/** What the page was given when it asked for sound. */
const sounds: { status: number; bytes: number }[] = [];

async function open(language: string, script = ''): Promise<void> {
  context = await browser.newContext({ viewport: { width: 900, height: 600 }, locale: language });
  page = await context.newPage();
  page.on('pageerror', ({ message }) => problems.push(message));
  page.on('response', (response) => {
    if (!response.url().endsWith('/sound.wav')) return;
    const note = (body: Buffer) => sounds.push({ status: response.status(), bytes: body.length });
    // A page that is closed meanwhile gives none.
    void response.body().then(note, () => undefined);
  });
  if (script) await page.addInitScript(script);
  await page.goto(url);
}

beforeAll(async () => {
  appliance = await Appliance.alone();
  url = await appliance.display();
  recording = appliance.kiroku('record', '--room', 'synthetic:pattern?size=64x48&rate=5', '--duration', '60s');
  browser = await startBrowser();
});

afterEach(async () => {
  await context.close();
  expect(problems).toEqual([]);
});

afterAll(async () => {
  await browser?.close();
  await recording;
  await appliance?.stop();
});

describe('the display', () => {
  it('shows no control until the pointer moves, and asks for no sound', async () => {
    await open('en-GB');
    await until('a code is shown', () =>
      page.evaluate(() => fetch('light.json').then(async (answer) => (((await answer.json()) as { rows: unknown }).rows ? true : undefined))),
    );
    await expect.poll(() => page.getByRole('button').isVisible()).toBe(false);
    await page.mouse.move(100, 100);
    await page.getByRole('button', { name: 'Sound' }).waitFor();
    await page.getByRole('button').waitFor({ state: 'hidden' });
    expect(sounds).toEqual([]);
  });

  it('shows codes in a browser that keeps nothing', async () => {
    await open('en-GB', "Object.defineProperty(window, 'localStorage', { get() { throw new Error('blocked'); } });");
    await until('the canvas is not dark', () =>
      page.evaluate(() => {
        const canvas = document.querySelector('canvas');
        const column = canvas?.getContext('2d')?.getImageData(canvas.width / 2, 0, 1, canvas.height).data;
        return column?.some((sample, at) => at % 4 === 0 && sample === 0xff) ? true : undefined;
      }),
    );
    await page.mouse.move(100, 100);
    await page.getByRole('button', { name: 'Sound' }).click();
    await page.getByRole('button', { name: 'Sound off' }).waitFor();
  });

  it('plays whole codes once somebody asked for it, and no more when told to stop', async () => {
    sounds.length = 0;
    await open('ja-JP');
    await page.mouse.move(100, 100);
    const button = page.getByRole('button', { name: '音を出す' });
    await button.click();
    await expect.poll(() => page.getByRole('button', { name: '音を止める' }).getAttribute('aria-pressed')).toBe('true');
    // Between light.json and sound.wav the second may end, and none begins any more.
    const fetched = () => sounds.filter((sound) => sound.status === 200);
    await until('two codes were fetched', () => (fetched().length >= 2 ? true : undefined));
    for (const sound of fetched()) expect(sound.bytes).toBe(kCodeBytes);
    await page.mouse.move(120, 120);
    await page.getByRole('button', { name: '音を止める' }).click();
    await button.waitFor();
  });
});
