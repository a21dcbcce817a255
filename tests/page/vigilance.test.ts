// Whoever watches over a room that records: live vital signs, and a monitor that says nothing, which is seen at once and heard by whoever wishes it.
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { Appliance, freePort, keepPicture, seriousBarriers, signInToRooms, startBrowser, startRecording, story, visit, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;

/** How many tones the page has made. */
const tones = (page: Page) => page.evaluate(() => (globalThis as unknown as { tones: number }).tones);

beforeAll(async () => {
  // Nobody sends to the second monitor.
  appliance = await Appliance.start(true, `[[room.stream]]\nname = "monitor"\nkind = "vitals"\nsource = "mllp://127.0.0.1:${await freePort()}"\n`);
  browser = await startBrowser();
  visitor = await visit(browser);
  await visitor.page.addInitScript(() => {
    const counted = globalThis as unknown as { tones: number };
    counted.tones = 0;
    globalThis.AudioContext = class extends AudioContext {
      override createOscillator(): OscillatorNode {
        counted.tones += 1;
        return super.createOscillator();
      }
    };
  });
});
afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

story('A room that records', (step) => {
  step('shows numbers and waves as the monitor does', async () => {
    const { page } = visitor;
    await signInToRooms(page, appliance);
    await startRecording(page);
    const vitals = page.getByRole('region', { name: 'Vital signs of or-1, live' });
    await expect.poll(() => vitals.locator('.vital', { hasText: 'HR' }).textContent()).toMatch(/HR.*\d\d/);
    await expect.poll(() => vitals.locator('.vital', { hasText: 'ABP' }).textContent()).toMatch(/\d\d+\/\d\d+/);
    const isDrawn = () =>
      vitals
        .locator('canvas')
        .first()
        .evaluate((canvas: HTMLCanvasElement) =>
          (canvas.getContext('2d') as CanvasRenderingContext2D)
            .getImageData(0, 0, canvas.width, canvas.height)
            .data.some((value, i) => i % 4 === 3 && value > 0),
        );
    await expect.poll(isDrawn).toBe(true);
  });

  step('says in words which monitor is silent, and makes no sound that nobody asked for', async () => {
    const { page } = visitor;
    await page.locator('.trouble', { hasText: 'monitor: nothing arrives' }).waitFor();
    await expect.poll(() => page.locator('.trouble').count()).toBe(1);
    await expect.poll(() => page.getByRole('button', { name: 'Sound on loss and silence' }).getAttribute('aria-pressed')).toBe('false');
    expect(await tones(page)).toBe(0);
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'live-vitals');
    await expectFits(visitor, 'vigilance');
  });

  step('archives pictures in another form from here on, by one choice', async () => {
    const { page } = visitor;
    const form = page.getByLabel(/From here on, archive endoscope as/i);
    await expect.poll(() => form.inputValue()).toBe('mpeg2');
    await form.selectOption('lossless');
    await expect.poll(() => form.inputValue()).toBe('lossless');
  });

  step('sounds for whoever wishes it, again while silence lasts, and remembers the wish', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Sound on loss and silence' }).click();
    // Two tones, so that one hears what it is like; two more each time.
    await expect.poll(() => tones(page)).toBeGreaterThanOrEqual(4);
    await page.reload();
    await page.locator('.trouble', { hasText: 'monitor: nothing arrives' }).waitFor();
    await expect.poll(() => page.getByRole('button', { name: 'Sound on loss and silence' }).getAttribute('aria-pressed')).toBe('true');
    await expect.poll(() => tones(page)).toBeGreaterThanOrEqual(2);
    await page.getByRole('button', { name: 'Sound on loss and silence' }).click();
    await expect.poll(() => page.getByRole('button', { name: 'Sound on loss and silence' }).getAttribute('aria-pressed')).toBe('false');
  });

  step('is as clear in Japanese', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: '日本語' }).click();
    await page.locator('.trouble', { hasText: 'monitor：信号がありません' }).waitFor();
    await page.getByRole('button', { name: '損失と無信号を音で知らせる' }).waitFor();
    await page.getByRole('button', { name: 'English' }).click();
    expect(visitor.problems).toEqual([]);
  });
});
