// A blinded reading in each browser: the page of 'kiroku quality study serve' before a study that the program made. Who reads here is the test.
import { type ChildProcess, execFile, spawn } from 'node:child_process';
import { once } from 'node:events';
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { promisify } from 'node:util';
import type { Browser, Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import { Appliance, type BrowserName, hasBrowser, kBrowsers, keepPicture, seriousBarriers, startBrowser, until } from './kit';

const run = promisify(execFile);
const kiroku = process.env['KIROKU_PROGRAM'] as string;

interface Study {
  films: { name: string }[];
  readers: { code: string; showings: { token: string; film: string }[] }[];
}
interface Key {
  codings: { coding: string }[];
  films: { name: string; coding: number }[];
}

let appliance: Appliance;
let clip = '';

const recipient = () => (/age1\S+/.exec(readFileSync(join(appliance.home, 'identity.txt'), 'utf8')) as RegExpExecArray)[0];
const folder = () => join(appliance.home, '..', 'reading');
const studyNow = () => JSON.parse(readFileSync(join(folder(), 'study.json'), 'utf8')) as Study;
const answers = (reader: number) =>
  readFileSync(join(folder(), 'answers', `reader-${reader}.jsonl`), 'utf8')
    .split('\n')
    .filter((line) => line !== '')
    .map((line) => JSON.parse(line) as { showing: string; points: number[]; plays: number; pictures: number });

/** `kiroku quality study serve`, at the address that it says. */
class Serving {
  private constructor(
    private readonly child: ChildProcess,
    readonly url: string,
  ) {}
  static async start(listen = '127.0.0.1:0'): Promise<Serving> {
    const child = spawn(kiroku, ['quality', 'study', 'serve', folder(), '--listen', listen, '--json'], { stdio: ['ignore', 'pipe', 'inherit'] });
    let said = '';
    child.stdout.on('data', (bytes: Buffer) => (said += bytes.toString()));
    const url = await until('the study is served', () => /"url": "([^"]+)"/.exec(said)?.[1]);
    return new Serving(child, url);
  }
  async end(signal: NodeJS.Signals = 'SIGTERM'): Promise<void> {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    this.child.kill(signal);
    await once(this.child, 'exit');
  }
}

async function makeStudy(...more: string[]): Promise<void> {
  await run(kiroku, ['quality', 'study', 'make', clip, '-o', folder(), '-r', recipient(), '--force', ...more]);
}

beforeAll(async () => {
  appliance = await Appliance.alone();
  await appliance.kiroku('record', '--endoscope', 'synthetic:endoscope?size=480x270&speed=max', '--duration', '2s', '--profile', 'lossless');
  const id = appliance.cases()[0] as string;
  clip = join(appliance.home, '..', 'clip.mkv');
  await appliance.kiroku('export', id, '--stream', 'endoscope', '-o', clip);
});
afterAll(async () => {
  await appliance?.stop();
});

describe.each<BrowserName>([...kBrowsers])('%s', (name) => {
  if (!hasBrowser(name)) {
    it.skip(`is not installed (Debian: ${name === 'firefox' ? 'firefox-esr' : 'chromium'})`, () => {});
    return;
  }
  let browser: Browser;
  let page: Page;
  let serving: Serving;
  let problems: string[];

  const signIn = async (reader: number) => {
    await page.getByLabel('Your code').fill((studyNow().readers[reader - 1] as Study['readers'][0]).code);
    await page.keyboard.press('Enter');
  };
  const shown = (place: number, of: number) => page.getByText(`Film ${place} of ${of}`).waitFor();
  const runs = () => page.waitForFunction(() => (document.querySelector('video')?.currentTime ?? 0) > 0);
  const stored = () => page.getByText('stored', { exact: true }).waitFor();
  const checked = () => page.locator('fieldset').evaluateAll((fields) => fields.map((one) => one.querySelector<HTMLInputElement>(':checked')?.value ?? ''));

  beforeAll(async () => {
    browser = await startBrowser(name);
  });
  afterAll(async () => {
    await browser?.close();
  });
  beforeEach(async () => {
    await run('rm', ['-rf', folder()]);
    await makeStudy('--repeats', '50');
    serving = await Serving.start();
    page = await (await browser.newContext({ viewport: { width: 1280, height: 800 } })).newPage();
    problems = [];
    page.on('pageerror', (error) => problems.push(error.message));
    await page.goto(serving.url);
  });
  afterEach(async () => {
    await page?.context().close();
    await serving?.end();
    expect(problems).toEqual([]);
  });

  it('leads a reader through films by keys, back and to the end', async () => {
    await page.getByLabel('Your code').fill('AAAA-AAAA');
    await page.keyboard.press('Enter');
    await page.getByText('There is no reader with this code.').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await signIn(1);
    await shown(1, 3);
    await runs();
    await expect.poll(() => page.locator('#next').isDisabled()).toBe(true);
    await page.keyboard.press('4');
    await page.keyboard.press('2');
    await expect.poll(checked).toEqual(['4', '2']);
    await stored();
    expect(await seriousBarriers(page)).toEqual([]);
    // A screenshot of Firefox puts a style into the page, which its policy refuses.
    if (name === 'chromium') await keepPicture(page, 'study');
    await page.waitForFunction(() => document.querySelector('video')?.ended);
    await page.keyboard.press('Enter');
    await shown(2, 3);
    // By hand instead of keys.
    await page.getByText('5fully').first().click();
    await page.getByText('1not at all').nth(1).click();
    await expect.poll(checked).toEqual(['5', '1']);
    await page.keyboard.press('Enter');
    await shown(3, 3);
    await page.keyboard.press('Backspace');
    await shown(2, 3);
    await expect.poll(checked).toEqual(['5', '1']);
    await page.getByRole('button', { name: 'next film' }).click();
    await shown(3, 3);
    await page.keyboard.press('3');
    await page.keyboard.press('3');
    await page.keyboard.press('Enter');
    await page.getByText('All films are judged').waitFor();
    const kept = answers(1);
    const showings = (studyNow().readers[0] as Study['readers'][0]).showings;
    expect(showings.map((one) => kept.findLast((line) => line.showing === one.token)?.points)).toEqual([
      [4, 2],
      [5, 1],
      [3, 3],
    ]);
    const first = kept.findLast((line) => line.showing === showings[0]?.token);
    expect(first?.plays).toBe(1);
    expect(first?.pictures).toBeGreaterThan(40);
  });

  it('goes on after a pause, a lost server and a closed window', async () => {
    await signIn(2);
    await shown(1, 3);
    await runs();
    await page.keyboard.press('5');
    await stored();
    await page.keyboard.press('p');
    await page.getByRole('heading', { name: 'Paused' }).waitFor();
    await expect.poll(() => page.locator('video').isVisible()).toBe(false);
    await page.keyboard.press('p');
    await page.locator('video').waitFor();
    // Killed in the middle: what is not stored is said, and stored when it answers again.
    const { host } = new URL(serving.url);
    await serving.end('SIGKILL');
    await page.keyboard.press('1');
    await page.getByText('The last answer is not stored').waitFor();
    await page.keyboard.press('Enter');
    await shown(1, 3);
    serving = await Serving.start(host);
    await page.keyboard.press('2');
    await stored();
    expect(answers(2).at(-1)?.points).toEqual([5, 2]);
    await page.reload();
    await signIn(2);
    await shown(2, 3);
    await page.keyboard.press('Backspace');
    await shown(1, 3);
    await expect.poll(checked).toEqual(['5', '2']);
    problems = []; // of the server that was away
  });

  it('speaks Japanese where the browser does', async () => {
    const words = await page.locator('[data-word]').evaluateAll((all) => all.map((one) => [one.getAttribute('data-word'), one.textContent]));
    const context = await browser.newContext({ locale: 'ja' });
    const other = await context.newPage();
    await other.goto(serving.url);
    await other.getByRole('heading', { name: '動画の評価' }).waitFor();
    await other.getByLabel('コード').fill('AAAA-AAAA');
    await other.keyboard.press('Enter');
    await other.getByText('このコードの評価者はいません。').waitFor();
    await other.getByLabel('コード').fill((studyNow().readers[0] as Study['readers'][0]).code);
    await other.keyboard.press('Enter');
    await other.getByText('動画 1 / 3').waitFor();
    await other.keyboard.press('4');
    await other.getByText('保存済み').waitFor();
    // Each word has another one.
    const others = await other.locator('[data-word]').evaluateAll((all) => all.map((one) => [one.getAttribute('data-word'), one.textContent]));
    expect(others.length).toBe(words.length);
    for (const [i, [word, text]] of others.entries()) {
      expect(text, word ?? '').toBeTruthy();
      expect(text, word ?? '').not.toBe(words[i]?.[1]);
    }
    await context.close();
  });

  it('hints at no coding, and shows what a coding left and nothing else', async () => {
    await run('rm', ['-rf', folder()]);
    await serving.end();
    await makeStudy('--repeats', '0', '--coding', 'mpeg2', '--rate', '600k', '--coding', 'lossless', '--coding', 'uncompressed');
    serving = await Serving.start();
    const sizes = new Set<string>();
    const asked: string[] = [];
    page.on('response', (answer) => {
      // What the page fetched itself is shown from its own memory.
      if (!answer.url().startsWith('blob:')) asked.push(new URL(answer.url()).pathname);
      if (answer.url().includes('/films/')) sizes.add(answer.headers()['content-length'] ?? '');
    });
    await page.goto(serving.url);
    await signIn(1);
    const hashes = new Map<string, string>();
    for (let place = 1; place <= 3; ++place) {
      await shown(place, 3);
      await runs();
      const hash = await page.evaluate(async () => {
        const video = document.querySelector('video') as HTMLVideoElement;
        video.pause();
        const found = new Promise((resolve) => video.addEventListener('seeked', resolve, { once: true }));
        video.currentTime = 1.02;
        await found;
        const canvas = document.createElement('canvas');
        canvas.width = video.videoWidth;
        canvas.height = video.videoHeight;
        const context = canvas.getContext('2d', { willReadFrequently: true }) as CanvasRenderingContext2D;
        // Until the picture that was sought is the one that is drawn.
        let last = '';
        for (let alike = 0; alike < 3;) {
          await new Promise((resolve) => requestAnimationFrame(resolve));
          context.drawImage(video, 0, 0);
          const bytes = context.getImageData(0, 0, canvas.width, canvas.height).data;
          const now = [...new Uint8Array(await crypto.subtle.digest('SHA-256', bytes))].join();
          alike = now === last ? alike + 1 : 0;
          last = now;
        }
        return last;
      });
      const showing = ((studyNow().readers[0] as Study['readers'][0]).showings[place - 1] as { film: string }).film;
      hashes.set(showing, hash);
      for (const word of ['mpeg', 'MPEG', 'lossless', 'uncompressed', 'clip.mkv', showing]) expect(await page.content()).not.toContain(word);
      await page.keyboard.press('3');
      await page.keyboard.press('3');
      await page.keyboard.press('Enter');
    }
    await page.getByText('All films are judged').waitFor();
    expect(sizes.size).toBe(1);
    for (const path of asked) expect(path).toMatch(/^\/(|begin|answer|study\.(js|css)|films\/[0-9a-f]{32})$/);
    expect(readdirSync(join(folder(), 'films')).length).toBe(3);
    // Which is which stands in the sealed key alone.
    const { stdout } = await run(kiroku, ['unseal', '-i', join(appliance.home, 'identity.txt'), join(folder(), 'key.age')]);
    const key = JSON.parse(stdout) as Key;
    const hashOf = (coding: string) => {
      const number = key.codings.findIndex((one) => one.coding === coding);
      return hashes.get(key.films.find((film) => film.coding === number)?.name ?? '');
    };
    expect(hashOf('lossless')).toBeDefined();
    expect(hashOf('lossless')).toBe(hashOf('uncompressed'));
    expect(hashOf('mpeg2')).not.toBe(hashOf('lossless'));
  });
});
