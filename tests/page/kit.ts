// A real appliance to look at: a home, kirokud with a room of synthetic sources, and `kiroku view`; and a browser.
import { type ChildProcess, execFile, spawn } from 'node:child_process';
import { once } from 'node:events';
import { appendFileSync, copyFileSync, existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { type AddressInfo, createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import axe from 'axe-core';
import { type Browser, type BrowserContext, chromium, firefox, type Page } from 'playwright-core';
import { afterAll, expect, it } from 'vitest';
import { Contract } from './contract';

const run = promisify(execFile);

function fromEnvironment(name: string): string {
  const value = process.env[name];
  if (!value) throw new Error(`${name} is not set; these tests are run by ctest (tests/page/run.sh)`);
  return value;
}
const kiroku = fromEnvironment('KIROKU_PROGRAM');
const kirokud = fromEnvironment('KIROKU_DAEMON_PROGRAM');

/** Small pictures: the machine that tests runs recorder, server and browser at once. A flash every 2 s of the case clock shows whether panes agree. */
const kRoom = `
[[room]]
name = "or-1"
[[room.stream]]
name = "endoscope"
kind = "video"
source = "synthetic:endoscope?size=480x270&flash=2"
[[room.stream]]
name = "room"
kind = "video"
source = "synthetic:room?size=480x270&flash=2"
[[room.stream]]
name = "vitals"
kind = "vitals"
source = "synthetic:patient"
`;

export async function until<T>(what: string, look: () => Promise<T | undefined> | T | undefined, seconds = 120): Promise<T> {
  const end = Date.now() + seconds * 1000;
  for (;;) {
    const found = await look();
    if (found !== undefined && found !== false) return found;
    if (Date.now() > end) throw new Error(`${what}: not within ${seconds} s`);
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}

const looking = new Set<Page>();
/** Where each open page is and what can be read there: without it a failure that nobody can repeat stays unexplained. */
async function whatIsSeen(): Promise<string> {
  const seen = [...looking].map(
    async (page) => `seen at ${new URL(page.url()).hash}: ${(await page.locator('body').innerText({ timeout: 1_000 })).slice(0, 800)}`,
  );
  return (await Promise.allSettled(seen)).map((one) => (one.status === 'fulfilled' ? one.value : `a page that does not answer: ${one.reason}`)).join('\n');
}

const kStory_ms = 1_200_000;
/**
 * A test of several steps, each of which goes on where the one before ended. They are one test, so that it does the same alone and in any order; where it
 * fails, the failure names its step.
 */
export function story(name: string, tell: (step: (what: string, action: () => Promise<void> | void) => void) => void): void {
  it(
    name,
    async () => {
      const steps: { what: string; action: () => Promise<void> | void }[] = [];
      tell((what, action) => steps.push({ what, action }));
      for (const { what, action } of steps) {
        const begun_ms = Date.now();
        try {
          await action();
        } catch (error) {
          if (error instanceof Error) error.message = `${what}: ${error.message}\n${await whatIsSeen()}`;
          throw error;
        }
        console.info(`${name}: ${what} (${Date.now() - begun_ms} ms)`);
      }
    },
    kStory_ms,
  );
}

const kPassword = 'correct horse battery';

export async function freePort(): Promise<number> {
  const server = createServer().listen(0, '127.0.0.1');
  await once(server, 'listening');
  const { port } = server.address() as AddressInfo;
  server.close();
  await once(server, 'close');
  return port;
}

export class Appliance {
  url = '';
  signIn = '';
  private readonly processes: ChildProcess[] = [];

  /** `folder`: what goes with the appliance. */
  private constructor(
    private readonly folder: string | undefined,
    readonly home: string,
  ) {}

  /** `live`: kirokud serves the page, with live pictures, to the user "anna"; else `kiroku view` does. `more`: lines of kiroku.toml that follow the room. */
  static async start(live = false, more = ''): Promise<Appliance> {
    const folder = mkdtempSync(join(tmpdir(), 'kiroku-page-'));
    const appliance = new Appliance(folder, join(folder, 'home'));
    await appliance.kiroku('init', '--demo');
    appendFileSync(join(appliance.home, 'kiroku.toml'), kRoom + more);
    if (live) {
      const listen = `127.0.0.1:${await freePort()}`;
      appendFileSync(join(appliance.home, 'kiroku.toml'), `[viewer]\nlisten = "${listen}"\n`);
      await appliance.addUser('anna', 'surgeon');
      appliance.url = `https://${listen}/`;
    }
    appliance.spawn(kirokud, ['--home', appliance.home]);
    await until('kirokud answers', () =>
      appliance.kiroku('status').then(
        () => true,
        () => undefined,
      ),
    );
    if (!live) await appliance.view();
    return appliance;
  }

  /** Without kirokud, so that `kiroku record` may record. */
  static async alone(): Promise<Appliance> {
    const folder = mkdtempSync(join(tmpdir(), 'kiroku-page-'));
    const appliance = new Appliance(folder, join(folder, 'home'));
    await appliance.kiroku('init', '--demo');
    await appliance.view();
    return appliance;
  }

  /** Shows the cases of a home that is there already, which it leaves as it is. */
  static async show(home: string): Promise<Appliance> {
    const appliance = new Appliance(undefined, home);
    await appliance.view();
    return appliance;
  }

  async kiroku(...parameters: string[]): Promise<string> {
    return (await run(kiroku, [...parameters, '--home', this.home])).stdout;
  }

  /** A case by a sealed plan, of what the source shows as fast as it can be taken; its identifier. */
  async recordPlanned(seal: string, stream: 'endoscope' | 'fluoroscopy', source: string, duration_ms: number): Promise<string> {
    const vitals = 'synthetic:patient?speed=max';
    const before = this.cases();
    await this.kiroku('record', `--${stream}`, source, '--vitals', vitals, '--profile', 'lossless', '--duration', `${duration_ms}ms`, '--plan', seal);
    return this.caseSince(before);
  }

  private spawn(program: string, parameters: string[]): ChildProcess {
    const child = spawn(program, parameters, { stdio: ['ignore', 'pipe', 'inherit'] });
    this.processes.push(child);
    return child;
  }

  private async view(listen = '127.0.0.1:0'): Promise<void> {
    const child = this.spawn(kiroku, ['view', '--home', this.home, '--listen', listen, '--web', fromEnvironment('KIROKU_PAGE'), '--json']);
    let said = '';
    child.stdout?.on('data', (bytes: Buffer) => (said += bytes.toString()));
    const answer = await until('kiroku view serves', () => {
      try {
        return JSON.parse(said) as { url: string; sign_in: string };
      } catch {
        return undefined;
      }
    });
    this.url = answer.url.replace(/\/?$/, '/');
    this.signIn = answer.sign_in;
  }

  /** `kiroku display`; the address of its page. */
  async display(): Promise<string> {
    const child = this.spawn(kiroku, ['display', '--home', this.home, '--listen', '127.0.0.1:0', '--json']);
    let said = '';
    child.stdout?.on('data', (bytes: Buffer) => (said += bytes.toString()));
    return await until('kiroku display serves', () => {
      try {
        return (JSON.parse(said) as { url: string }).url;
      } catch {
        return undefined;
      }
    });
  }

  /** `kiroku plan serve`, `kiroku train serve` and `kiroku respire serve` without an address of their own: `kiroku view` leads to them. */
  async servePlanning(): Promise<void> {
    await this.behind('plan', 'serve', '--gpu', 'off');
  }
  async serveTraining(): Promise<void> {
    await this.behind('train', 'serve', '--vertices', '900', '--practice', '0');
  }
  async serveBreathing(...parameters: string[]): Promise<void> {
    await this.behind('respire', 'serve', ...parameters);
  }
  private async behind(...parameters: string[]): Promise<void> {
    const child = this.spawn(kiroku, [...parameters, '--home', this.home, '--json']);
    let said = '';
    child.stdout?.on('data', (bytes: Buffer) => (said += bytes.toString()));
    await until(`kiroku ${parameters.join(' ')} serves`, () => (said.includes('}') ? true : undefined));
  }

  /** `kiroku view` ends and begins anew at the same address; all sessions are gone. */
  async restartView(): Promise<void> {
    const child = this.processes.pop() as ChildProcess;
    child.kill('SIGTERM');
    await once(child, 'exit');
    await this.view(new URL(this.url).host);
  }

  readonly password = kPassword;
  /** With `password`. */
  async addUser(name: string, role: string): Promise<void> {
    await run(kiroku, ['user', 'add', name, '--role', role, '--home', this.home], { env: { ...process.env, KIROKU_PASSPHRASE: kPassword } });
  }

  /** Cuts the first line of the case's ledger short, so that nothing of it can be read. */
  spoilLedger(id: string): void {
    const file = join(this.home, 'archive', id, 'ledger.jsonl');
    const text = readFileSync(file, 'utf8');
    rmSync(file);
    writeFileSync(file, text.slice(40));
  }

  /** The demonstration's, which opens its recordings. */
  identity(): string {
    const found = /^AGE-SECRET-KEY-1\S+$/m.exec(readFileSync(join(this.home, 'identity.txt'), 'utf8'));
    if (!found) throw new Error('the home has no identity');
    return found[0];
  }

  /** Puts the demonstration's plan among the home's, and seals it; its folder. */
  async sealPlan(): Promise<string> {
    const folder = join(this.home, 'plans', 'demonstration');
    mkdirSync(folder, { recursive: true });
    const demonstration = join(fromEnvironment('KIROKU_SOURCE_DIR'), 'deploy', 'demonstration');
    copyFileSync(join(demonstration, 'plan.json'), join(folder, 'plan.json'));
    const { stdout } = await run('awk', ['-f', join(demonstration, 'organ.awk')], { env: { ...process.env, LC_ALL: 'C' }, maxBuffer: 1 << 24 });
    writeFileSync(join(folder, 'organ.nrrd'), stdout);
    await this.kiroku('plan', 'seal', join(folder, 'plan.json'));
    return folder;
  }

  cases(): string[] {
    return readdirSync(join(this.home, 'archive'))
      .filter((name) => /^\d{8}T/.test(name))
      .sort();
  }

  /** The one case that is there and was not `before`. Names of two that began in one second stand in no order. */
  caseSince(before: readonly string[]): string {
    const [one, ...others] = this.cases().filter((name) => !before.includes(name));
    if (one === undefined || others.length > 0) throw new Error(`one new case was looked for, and there are ${one === undefined ? 0 : 1 + others.length}`);
    return one;
  }

  /** Flips one bit in the middle of a segment of the case. */
  tamper(id: string, stream: string, segment: number): void {
    const folder = join(this.home, 'archive', id, 'segments', stream);
    const name = readdirSync(folder).find((one) => one.startsWith(String(segment).padStart(8, '0')));
    if (!name) throw new Error(`${id} has no segment ${segment} of ${stream}`);
    const bytes = readFileSync(join(folder, name));
    const at = bytes.length >> 1;
    bytes.writeUInt8(bytes.readUInt8(at) ^ 1, at);
    rmSync(join(folder, name));
    writeFileSync(join(folder, name), bytes);
  }

  async stop(): Promise<void> {
    for (const child of this.processes.reverse()) {
      const ended = new Promise((resolve) => child.once('exit', resolve));
      if (child.exitCode === null && child.signalCode === null) {
        child.kill('SIGTERM');
        await ended;
      }
    }
    if (this.folder) rmSync(this.folder, { recursive: true, force: true });
  }
}

export type BrowserName = 'chromium' | 'firefox';
export const kBrowsers: readonly BrowserName[] = ['chromium', 'firefox'];

const kProgramOf: Record<BrowserName, string> = { chromium: 'KIROKU_BROWSER', firefox: 'KIROKU_FIREFOX' };
/** tests/page/run.sh looks for both, and where KIROKU_PAGE_REQUIRED is set it fails without one. */
export const hasBrowser = (name: BrowserName): boolean => Boolean(process.env[kProgramOf[name]]);

export async function startBrowser(name: BrowserName = 'chromium'): Promise<Browser> {
  const executablePath = fromEnvironment(kProgramOf[name]);
  if (name === 'firefox') {
    // "moz-firefox" has Playwright speak WebDriver BiDi, which stock Firefox knows; otherwise it wants its own patched one.
    return firefox.launch({ executablePath, channel: 'moz-firefox', firefoxUserPrefs: { 'media.autoplay.default': 0 } });
  }
  return chromium.launch({
    executablePath,
    args: [
      '--headless',
      '--no-sandbox',
      '--disable-gpu',
      '--disable-quic',
      '--no-first-run',
      '--disable-background-networking',
      '--disable-component-update',
      '--disable-sync',
      '--autoplay-policy=no-user-gesture-required',
    ],
  });
}

/** Tests share their machine with a recorder, a server and a browser, and others' programs: what takes long is looked at in tests/bench/. */
const kPatience_ms = 60_000;
/** What has the lowest priority gets what others leave. */
export const kMaking_ms = 300_000;

export interface Visitor {
  context: BrowserContext;
  page: Page;
  /** What went wrong in the page, by the browser's own words. */
  problems: string[];
  /** Every address the page asked for. */
  asked: string[];
}

const contract = new Contract(fromEnvironment('KIROKU_SOURCE_DIR'));
// Of every file of tests that has visitors, whatever else it looks at.
afterAll(async () => {
  await contract.settle();
  expect(contract.breaches, 'what page and server said to each other').toEqual([]);
  expect(contract.checked > 0).toBe(contract.visited);
});

function listen({ page, problems, asked }: Visitor): void {
  contract.listen(page);
  looking.add(page);
  page.on('close', () => looking.delete(page));
  page.on('pageerror', ({ message }) => {
    // Before it makes a picture of Firefox, Playwright adds a style, which the page's content security policy refuses.
    if (!(process.env['KIROKU_PICTURES'] && /blocked an inline style \(style-src-elem\)/.test(message))) problems.push(message);
  });
  page.on('console', (message) => {
    // That nobody is signed in yet, that a case was never verified, that a changed segment is not shown, or that what was watched live has ended, is an answer.
    if (
      message.type() === 'error' &&
      !/status of (401|404|422)|^WebSocket connection to .* failed: (HTTP Authentication failed|.*Unexpected response code: 4\d\d)/.test(message.text())
    )
      problems.push(`${message.text()} ${message.location().url}`);
  });
  page.on('request', (request) => asked.push(request.url()));
}

export async function visit(browser: Browser, language = 'en'): Promise<Visitor> {
  const context = await browser.newContext({ ignoreHTTPSErrors: true, viewport: { width: 1440, height: 900 }, locale: language, acceptDownloads: true });
  context.setDefaultTimeout(kPatience_ms);
  const visitor: Visitor = { context, page: await context.newPage(), problems: [], asked: [] };
  listen(visitor);
  return visitor;
}

/** A new tab in the place of the old one: whoever signed in still is, and what is remembered for a tab is forgotten. */
export async function newTab(visitor: Visitor): Promise<void> {
  await visitor.page.close();
  visitor.page = await visitor.context.newPage();
  listen(visitor);
}

/** Someone who has signed in by the appliance's own link and sees its cases. */
export async function visitSignedIn(browser: Browser, appliance: Appliance): Promise<Visitor> {
  const visitor = await visit(browser);
  await visitor.page.goto(appliance.signIn);
  await visitor.page.getByRole('heading', { name: 'Cases' }).waitFor();
  return visitor;
}

/** Someone who has signed in, and sees the plan of a case. */
export async function visitPlan(browser: Browser, appliance: Appliance, id: string): Promise<Visitor> {
  const visitor = await visitSignedIn(browser, appliance);
  await visitor.page.locator('.case-link', { hasText: id }).click();
  await visitor.page.getByRole('tab', { name: 'Plan' }).click();
  return visitor;
}

/** By the password of "anna"; then the rooms are seen. */
export async function signInToRooms(page: Page, appliance: Appliance): Promise<void> {
  await page.goto(appliance.url);
  await page.getByLabel('Name').fill('anna');
  await page.getByLabel('Password').fill(kPassword);
  await page.keyboard.press('Enter');
  await page.getByRole('heading', { name: 'Cases' }).waitFor();
  await page.goto(`${appliance.url}#/rooms`);
}

/** Of the room that is shown, saying nothing of the patient. */
export async function startRecording(page: Page): Promise<void> {
  await page.getByRole('button', { name: 'Start recording' }).click();
  await page.getByRole('button', { name: 'Start without a patient' }).click();
}

/** Findings of axe-core that are serious or critical, with the elements. */
export async function seriousBarriers(page: Page): Promise<string[]> {
  // By the debugger, which the page's content security policy does not bind.
  await page.evaluate(axe.source);
  const result = await page.evaluate(() => (globalThis as unknown as { axe: typeof axe }).axe.run(document, { resultTypes: ['violations'] }));
  return result.violations
    .filter((one) => one.impact === 'serious' || one.impact === 'critical')
    .map((one) => `${one.id}: ${one.help}: ${one.nodes.map((node) => node.target.join(' ')).join(' | ')}`);
}

export const clockOf = async (page: Page): Promise<number> => {
  const text = await page.locator('.clock-now').textContent();
  const [hours, minutes, seconds] = (text ?? '').split(':').map(Number);
  return (hours ?? NaN) * 3600 + (minutes ?? NaN) * 60 + (seconds ?? NaN);
};

/** Waits until every video of the case shows the picture of where the clock stands. */
export async function settled(page: Page): Promise<void> {
  await page.waitForFunction(() => {
    const videos = [...document.querySelectorAll('video')];
    return videos.length > 0 && videos.every((one) => !one.seeking && one.readyState >= 2);
  });
}

/** Keeps pictures where KIROKU_PICTURES says: docs/pictures/viewer-*.png are made so. */
export async function keepPicture(page: Page, name: string): Promise<void> {
  const folder = process.env['KIROKU_PICTURES'];
  if (!folder) return;
  if (!existsSync(folder)) mkdirSync(folder, { recursive: true });
  await page.screenshot({ path: join(folder, `viewer-${name}.png`) });
}

export async function near(page: Page, seconds: number, tolerance = 0.05): Promise<void> {
  await expect.poll(() => clockOf(page)).toSatisfy((at: number) => Math.abs(at - seconds) <= tolerance, `${seconds} s`);
}

/** How far the endoscope is ahead of the room whenever it shows a new frame, in seconds of the case: by the frames' own times and when they came to the
 * screen, both playing at `rate`. */
export async function measuredOffsets(page: Page, seconds: number, rate = 1): Promise<number[]> {
  return page.evaluate(
    async ([length_s, rate]) => {
      const videos = [...document.querySelectorAll('video')] as [HTMLVideoElement, HTMLVideoElement];
      // Until both run.
      while (videos.some((one) => one.paused || one.readyState < 3)) await new Promise(requestAnimationFrame);
      await new Promise((resolve) => setTimeout(resolve, 1000));
      const shown: { media: number; at: number }[][] = videos.map(() => []);
      videos.forEach((one, which) => {
        const note: VideoFrameRequestCallback = (_, frame) => {
          shown[which]?.push({ media: frame.mediaTime, at: frame.expectedDisplayTime });
          one.requestVideoFrameCallback(note);
        };
        one.requestVideoFrameCallback(note);
      });
      await new Promise((resolve) => setTimeout(resolve, length_s * 1000));
      // The other showed its last frame a little earlier, and would be so much further by now.
      const [first, second] = shown as [{ media: number; at: number }[], { media: number; at: number }[]];
      return first.flatMap((frame) => {
        const beside = second.findLast((one) => one.at <= frame.at + 1);
        return beside ? [frame.media - beside.media - (rate * (frame.at - beside.at)) / 1000] : [];
      });
    },
    [seconds, rate] as const,
  );
}
