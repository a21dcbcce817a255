// Sound beside the pictures: a flash and a beep at the same moments of the case clock, seen and heard in a browser.
import type { Browser } from 'playwright-core';
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import { Appliance, keepPicture, newTab, seriousBarriers, settled, startBrowser, visitSignedIn, type Visitor } from './kit';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
let withSound = '';
let without = '';

const press = (key: string) => visitor.page.keyboard.press(key);
const openCase = async (id: string) => {
  await visitor.page.goto(`${appliance.url}#/cases/${id}`);
  await visitor.page.locator('.timeline').waitFor();
  await settled(visitor.page);
};
const pane = (stream: string) => visitor.page.locator(`.pane[data-stream=${stream}]`);
const heard = (): Promise<boolean[]> => visitor.page.locator('.pane video').evaluateAll((videos: HTMLVideoElement[]) => videos.map((one) => !one.muted));

beforeAll(async () => {
  appliance = await Appliance.alone();
  const record = async (duration: string, ...more: string[]) => {
    const options = 'size=320x180&flash=1&beep=1&speed=max';
    await appliance.kiroku(
      'record',
      '--endoscope',
      `synthetic:pattern?${options}`,
      '--room',
      `synthetic:pattern?${options}`,
      '--duration',
      duration,
      '--segment',
      '3s',
      ...more,
    );
    // Cases are named by the second.
    await new Promise((resolve) => setTimeout(resolve, 1100));
    return appliance.cases().at(-1) as string;
  };
  withSound = await record('30s', '--audio');
  without = await record('4s');
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

// In a tab of its own: which sounds are heard is remembered for a tab.
beforeEach(async () => {
  await newTab(visitor);
  await openCase(withSound);
  await expect.poll(heard).toEqual([true, false]);
});

afterEach(() => {
  expect(visitor.problems).toEqual([]);
});

describe('Sound', () => {
  it('is said to be there, and only the master is heard', async () => {
    await expect.poll(() => visitor.page.getByText('Viewing copy · sound').count()).toBe(2);
    await expect.poll(() => pane('endoscope').getAttribute('aria-label')).toBe('Endoscope, with sound');
    await expect.poll(() => pane('endoscope').getByRole('button', { name: 'Sound of Endoscope' }).getAttribute('aria-pressed')).toBe('true');
    await expect.poll(() => pane('room').getByRole('button', { name: 'Sound of Room' }).getAttribute('aria-pressed')).toBe('false');
    await expect.poll(heard).toEqual([true, false]);
    expect(await seriousBarriers(visitor.page)).toEqual([]);
  });

  it('plays, and beeps when the picture flashes', async () => {
    await press('Space');
    const said = await visitor.page.evaluate(measure, { least: 6, most_s: 24 });
    await press('Space');
    expect(said.decoded).toBeGreaterThan(0);
    const sorted = [...said.apart].sort((a, b) => a - b);
    const middle = sorted[sorted.length >> 1] as number;
    console.log(
      `beep after flash, in ${said.apart.length} seconds of playing: in the middle ${middle.toFixed(1)} ms, from ${sorted[0]?.toFixed(1)} to ${sorted.at(-1)?.toFixed(1)} ms`,
    );
    expect(said.apart.length).toBeGreaterThan(4);
    // Nobody notices 45 ms early and 125 ms late (ITU-R BT.1359). The clocks of a machine without a sound card may add as much again; a track that is a
    // piece or a second off would be seen.
    expect(middle).toBeGreaterThan(-90);
    expect(middle).toBeLessThan(250);
  });

  it('goes over the borders of pieces without a stop', async () => {
    await press('Home');
    await settled(visitor.page);
    await press('Space');
    await expect
      .poll(() =>
        visitor.page
          .locator('.pane video')
          .first()
          .evaluate((one: HTMLVideoElement) => one.currentTime),
      )
      .toBeGreaterThan(7);
    await press('Space');
    const ranges = await visitor.page
      .locator('.pane video')
      .first()
      .evaluate((one: HTMLVideoElement) => Array.from({ length: one.buffered.length }, (_, i) => [one.buffered.start(i), one.buffered.end(i)]));
    expect(ranges.length).toBe(1);
    expect(ranges[0]?.[0]).toBeLessThan(0.1);
  });

  it('is switched off and on by M, and by the button of a pane', async () => {
    const { page } = visitor;
    await press('m');
    await expect.poll(heard).toEqual([false, false]);
    await expect.poll(() => page.locator('[role=status].only-heard').textContent()).toContain('Sound off');
    await press('m');
    await expect.poll(heard).toEqual([true, false]);
    await pane('room').getByRole('button', { name: 'Sound of Room' }).click();
    await expect.poll(heard).toEqual([true, true]);
    await press('m');
    await expect.poll(heard).toEqual([false, false]);
  });

  it('has a volume, which is remembered with the rest while the tab is open', async () => {
    const { page } = visitor;
    await press('m');
    await expect.poll(heard).toEqual([false, false]);
    await pane('room').getByRole('slider', { name: 'Volume of Room' }).fill('0.4');
    await expect.poll(heard).toEqual([false, true]);
    await page.reload();
    await settled(page);
    await expect
      .poll(() => page.locator('.pane video').evaluateAll((videos: HTMLVideoElement[]) => videos.map((one) => [one.muted, one.volume])))
      .toEqual([
        [true, 1],
        [false, 0.4],
      ]);
    await pane('room').getByRole('button', { name: 'Sound of Room' }).click();
    await pane('endoscope').getByRole('button', { name: 'Sound of Endoscope' }).click();
    await expect.poll(heard).toEqual([true, false]);
    await keepPicture(page, 'sound');
  });

  it('is heard from half to double speed alone', async () => {
    await settled(visitor.page);
    await visitor.page.locator('#main').focus();
    for (const [key, count, is] of [
      [']', 3, true],
      [']', 1, false],
      ['[', 5, true],
    ] as const) {
      for (let i = 0; i < count; ++i) await press(key);
      await expect.poll(heard).toEqual([is, false]);
    }
    for (let i = 0; i < 3; ++i) await press('[');
    await expect.poll(heard).toEqual([false, false]);
    for (let i = 0; i < 4; ++i) await press(']');
    await expect.poll(heard).toEqual([true, false]);
  });

  it('stands in the help, in both languages', async () => {
    const { page } = visitor;
    await press('?');
    await page.getByRole('dialog', { name: 'Keys' }).getByText('Sound on or off').waitFor();
    await press('Escape');
    await page.getByRole('button', { name: '日本語' }).click();
    await expect.poll(() => page.getByText('閲覧用複製 · 音声').count()).toBe(2);
    await page.getByRole('button', { name: 'English' }).click();
  });

  it('is neither shown nor asked for where none was recorded', async () => {
    await openCase(without);
    await expect.poll(() => visitor.page.getByText('Viewing copy', { exact: true }).count()).toBe(2);
    await expect.poll(() => visitor.page.locator('.pane-sound').count()).toBe(0);
    expect(visitor.asked.filter((address) => address.includes(without) && address.includes('/sound/'))).toEqual([]);
    await press('m');
    await expect.poll(() => visitor.page.locator('[role=status].only-heard').textContent()).toContain('This case has no sound');
  });
});

/**
 * Runs in the page: by how many milliseconds the beep leaves for the loudspeaker after the white frame came to the screen, of each second that is played; and
 * how many bytes of sound were decoded meanwhile.
 */
async function measure({ least, most_s }: { least: number; most_s: number }): Promise<{ apart: number[]; decoded: number }> {
  const video = document.querySelector('video') as HTMLVideoElement & { webkitAudioDecodedByteCount: number };
  const before = video.webkitAudioDecodedByteCount;
  const context = new AudioContext({ sampleRate: 48_000 });
  const analyser = context.createAnalyser();
  analyser.fftSize = 8192;
  const source = context.createMediaElementSource(video);
  source.connect(analyser);
  analyser.connect(context.destination);
  // A busy browser does not show every picture: by the one that was shown nearest to the flash, each second.
  const flashes = new Map<number, { off_s: number; at_ms: number }>();
  const note: VideoFrameRequestCallback = (_, frame) => {
    const second = Math.round(frame.mediaTime);
    const off_s = second - frame.mediaTime;
    if (Math.abs(off_s) < Math.abs(flashes.get(second)?.off_s ?? 0.2)) flashes.set(second, { off_s, at_ms: frame.expectedDisplayTime + off_s * 1000 });
    video.requestVideoFrameCallback(note);
  };
  video.requestVideoFrameCallback(note);
  const beeps: number[] = [];
  const samples = new Float32Array(analyser.fftSize);
  const apart = () => [...flashes.values()].flatMap(({ at_ms }) => beeps.map((beep) => beep - at_ms).filter((one) => Math.abs(one) < 400));
  const end_ms = performance.now() + most_s * 1000;
  while (performance.now() < end_ms && apart().length < least) {
    await new Promise((resolve) => setTimeout(resolve, 10));
    analyser.getFloatTimeDomainData(samples);
    const now_ms = performance.now();
    // The first loud sample behind 50 ms of silence.
    let quiet = 0;
    for (let at = 0; at < samples.length; ++at) {
      if (Math.abs(samples[at] as number) < 0.05) {
        ++quiet;
        continue;
      }
      if (quiet > 2400) {
        const begun_ms = now_ms - ((samples.length - at) / context.sampleRate) * 1000;
        if (begun_ms - (beeps.at(-1) ?? 0) > 500) beeps.push(begun_ms);
      }
      quiet = 0;
    }
  }
  return { apart: apart(), decoded: video.webkitAudioDecodedByteCount - before };
}
