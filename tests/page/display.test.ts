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

async function open(language: string): Promise<void> {
  context = await browser.newContext({ viewport: { width: 900, height: 600 }, locale: language });
  page = await context.newPage();
  page.on('pageerror', ({ message }) => problems.push(message));
  page.on('response', (response) => {
    if (!response.url().endsWith('/sound.wav')) return;
    void response.body().then((body) => sounds.push({ status: response.status(), bytes: body.length }));
  });
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

  it('plays whole codes once somebody asked for it, and no more when told to stop', async () => {
    await open('ja-JP');
    await page.mouse.move(100, 100);
    const button = page.getByRole('button', { name: '音を出す' });
    await button.click();
    await expect.poll(() => page.getByRole('button', { name: '音を止める' }).getAttribute('aria-pressed')).toBe('true');
    await until('two codes were fetched', () => (sounds.length >= 2 ? true : undefined));
    for (const sound of sounds) expect(sound).toEqual({ status: 200, bytes: kCodeBytes });
    await page.mouse.move(120, 120);
    await page.getByRole('button', { name: '音を止める' }).click();
    await button.waitFor();
  });
});
