// What a long case costs in a browser, and whether its panes stay together: figures, printed by tests/bench/page.sh.
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, expect, it } from 'vitest';
import { Appliance, clockOf, measuredOffsets, settled, startBrowser, visitSignedIn, type Visitor } from './kit';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
let last = '';

beforeAll(async () => {
  const home = process.env['KIROKU_HOME'];
  if (!home) throw new Error('KIROKU_HOME is not set: run tests/bench/page.sh');
  appliance = await Appliance.show(home);
  last = appliance.cases().at(-1) as string;
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
}, 60_000);

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

const sorted = (values: number[]) => values.map(Math.abs).sort((a, b) => a - b);
const milliseconds = (seconds: number | undefined) => `${((seconds ?? NaN) * 1000).toFixed(1)} ms`;

it('opens', async () => {
  const { page } = visitor;
  const times: number[] = [];
  for (let i = 0; i < 5; ++i) {
    await page.goto(`${appliance.url}#/cases`);
    const link = page.locator('.case-link', { hasText: last });
    await link.waitFor();
    const start = performance.now();
    await link.click();
    await settled(page);
    times.push((performance.now() - start) / 1000);
  }
  console.log(`first picture of the case in every pane: ${times.map((one) => milliseconds(one)).join(', ')}`);
});

it('keeps its panes together to the end, at eight times its speed', async () => {
  const { page } = visitor;
  const end = Number(await page.locator('.overview').getAttribute('aria-valuemax'));
  await page.keyboard.press('Home');
  await settled(page);
  await page.locator('.speed select').selectOption('8');
  await page.keyboard.press('Space');
  const started = performance.now();
  const largest: number[] = [];
  // A round takes about a minute of the case; the last one must leave some.
  while ((await clockOf(page)) < end - 90) {
    const offsets = sorted(await measuredOffsets(page, 3, 8));
    largest.push(offsets[Math.floor(0.95 * offsets.length)] as number);
    await page.waitForTimeout(3000);
  }
  const played_s = await clockOf(page);
  console.log(
    `played ${Math.round(played_s)} s in ${Math.round((performance.now() - started) / 1000)} s; apart meanwhile, 95 % of frames within ${milliseconds(sorted(largest).at(-1))} of the case`,
  );
  await page.locator('.speed select').selectOption('1');
  const offsets = sorted(await measuredOffsets(page, 10));
  console.log(
    `then at its own speed: ${offsets.length} frames, in the middle ${milliseconds(offsets[offsets.length >> 1])} apart, 95 % within ${milliseconds(offsets[Math.floor(0.95 * offsets.length)])}, at most ${milliseconds(offsets.at(-1))}`,
  );
  expect(offsets.length).toBeGreaterThan(100);
});
