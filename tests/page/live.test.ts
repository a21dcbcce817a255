// Live pictures in a browser, before a kirokud that serves the page itself and records what is watched.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, WebSocket } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { Appliance, keepPicture, seriousBarriers, signInToRooms, startBrowser, startRecording, story, visit, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
const sockets: WebSocket[] = [];

beforeAll(async () => {
  appliance = await Appliance.start(true);
  browser = await startBrowser();
  visitor = await visit(browser);
  visitor.page.on('websocket', (socket) => sockets.push(socket));
});

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

const pane = (stream: string) => visitor.page.locator(`.live-pane[data-stream=${stream}]`);
/** One of each stream, and one of who looks on. */
const open = () => sockets.filter((one) => !one.isClosed()).length;

/** Pictures of a stream as they come onto the screen, for some seconds: case clock, Unix time of showing, brightness (0 to 255) of the middle. */
const watch = (stream: string, seconds: number) =>
  pane(stream)
    .locator('video')
    .evaluate(
      (video: HTMLVideoElement, seconds) =>
        new Promise<{ media_s: number; shown_ms: number; brightness: number }[]>((resolve) => {
          const seen: { media_s: number; shown_ms: number; brightness: number }[] = [];
          const canvas = new OffscreenCanvas(8, 8).getContext('2d', { willReadFrequently: true }) as OffscreenCanvasRenderingContext2D;
          const look: VideoFrameRequestCallback = (now, frame) => {
            canvas.drawImage(video, 0, 0, 8, 8);
            const pixels = canvas.getImageData(2, 2, 4, 4).data.filter((_, i) => i % 4 !== 3);
            seen.push({
              media_s: frame.mediaTime,
              shown_ms: performance.timeOrigin + Math.max(now, frame.expectedDisplayTime),
              brightness: pixels.reduce((sum, one) => sum + one, 0) / pixels.length,
            });
            video.requestVideoFrameCallback(look);
          };
          video.requestVideoFrameCallback(look);
          setTimeout(() => resolve(seen), seconds * 1000);
        }),
      seconds,
    );

const hide = (hidden: boolean) =>
  visitor.page.evaluate((hidden) => {
    Object.defineProperty(document, 'visibilityState', { configurable: true, get: () => (hidden ? 'hidden' : 'visible') });
    document.dispatchEvent(new Event('visibilitychange'));
  }, hidden);

story('A room that is recording', (step) => {
  step('shows nothing, and asks for nothing, before it records', async () => {
    const { page } = visitor;
    await signInToRooms(page, appliance);
    await page.getByRole('button', { name: 'Start recording' }).waitFor();
    expect(sockets).toEqual([]);
  });

  step('shows its streams moving, and how old the pictures are', async () => {
    const { page } = visitor;
    await startRecording(page);
    for (const stream of ['endoscope', 'room']) {
      await pane(stream)
        .getByText(/Live, \d+\.\d\d s behind/)
        .waitFor();
      await pane(stream).locator('video[aria-label]').waitFor();
    }
    // A flash is one picture of fifty, and a busy machine does not show them all.
    const isWhite = (one: { brightness: number }) => one.brightness > 220;
    const seen = await watch('endoscope', 4.5);
    for (let i = 0; i < 5 && !seen.some(isWhite); ++i) seen.push(...(await watch('endoscope', 4.5)));
    expect(seen.length).toBeGreaterThan(20);
    for (const [i, one] of seen.entries()) if (i > 0) expect(one.media_s).toBeGreaterThan(seen[i - 1]?.media_s ?? 0);
    // White at whole even seconds, for one picture of 25 a second. What is drawn may already be a picture after the one that was told of, never one before
    // (Chromium runs the callback when it finds time to).
    const white = seen.filter(isWhite);
    expect(white.length).toBeGreaterThan(0);
    for (const one of white) {
      const until_s = 2 * Math.ceil(one.media_s / 2 - 0.001) - one.media_s;
      expect(until_s).toBeLessThan(0.25);
    }
    expect(new Set(seen.map((one) => one.brightness)).size).toBeGreaterThan(5);
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'live');
    await expectFits(visitor, 'live');
  });

  step('has what `kiroku status` says beside them', async () => {
    const { page } = visitor;
    await expect.poll(() => page.locator('.state-good', { hasText: 'delivers' }).count()).toBe(3);
    await page.getByText(/\d+ received, 0 missed/).waitFor();
    await page.getByText(/\d h left/).waitFor();
    const status = JSON.parse(await appliance.kiroku('status', '--json')) as { rooms: { streams: { dropped: number }[] }[] };
    for (const stream of status.rooms[0]?.streams ?? []) expect(stream.dropped).toBe(0);
  });

  step('is watched by nobody while the page is hidden, and again when it is seen', async () => {
    await expect.poll(open).toBe(3);
    await hide(true);
    await expect.poll(open).toBe(0);
    await expect.poll(() => visitor.page.locator('video').count()).toBe(0);
    await hide(false);
    await expect.poll(open).toBe(3);
    await pane('endoscope')
      .getByText(/Live, /)
      .waitFor();
  });

  step('comes back by itself after the connection broke', async () => {
    const { page } = visitor;
    const before = sockets.length;
    let broken = 0;
    await page.routeWebSocket(/\/api\/live\/or-1\/endoscope$/, (route) => {
      const server = route.connectToServer();
      if (++broken === 1) setTimeout(() => void server.close().then(() => route.close({ code: 1012 })), 1500);
    });
    await page.reload();
    await expect.poll(() => broken).toBe(2);
    await expect.poll(async () => (await watch('endoscope', 1)).length).toBeGreaterThan(5);
    expect(sockets.length).toBeGreaterThan(before);
  });

  step('is said in Japanese, too', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: '日本語' }).click();
    await pane('endoscope')
      .getByText(/ライブ（\d+\.\d\d 秒遅れ）/)
      .waitFor();
    await page.getByRole('button', { name: 'English' }).click();
  });

  // Speeds are no tests: tests/bench/live.sh asks for it.
  if (process.env['KIROKU_MEASURE'])
    step('is measured from glass to glass', async () => {
      const seen = await watch('endoscope', 40);
      const id = appliance.cases().at(-1) as string;
      const opened = JSON.parse(readFileSync(join(appliance.home, 'archive', id, 'ledger.jsonl'), 'utf8').split('\n', 1)[0] ?? '') as {
        utc: string;
        mono_ns: number;
      };
      const zero_ms = Date.parse(opened.utc) - opened.mono_ns / 1e6;
      const sorted = (all: number[]) => all.sort((one, other) => one - other);
      const ages = sorted(seen.map((one) => one.shown_ms - zero_ms - one.media_s * 1000));
      const flashes = sorted(seen.filter((one) => one.brightness > 220).map((one) => one.shown_ms - zero_ms - 2000 * Math.round(one.media_s / 2)));
      const at = (all: number[], part: number) => `${Math.round(all[Math.floor(all.length * part)] ?? NaN)} ms`;
      process.stdout.write(
        `glass to glass: ${ages.length} pictures of ${40 * 25}, median ${at(ages, 0.5)}, p95 ${at(ages, 0.95)}; by ${flashes.length} flashes in the picture: median ${at(flashes, 0.5)}, worst ${at(flashes, 0.999)}\n`,
      );
      expect(flashes.length).toBeGreaterThan(5);
    });

  step('ends with the recording', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Stop', exact: true }).click();
    await page.locator('dialog').getByRole('button', { name: 'Stop' }).click();
    await page.getByRole('button', { name: 'Start recording' }).waitFor();
    await expect.poll(() => page.locator('.live-pane').count()).toBe(0);
    expect(visitor.problems).toEqual([]);
  });
});
