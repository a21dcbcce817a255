// The trainer's page in a browser, before a real `kiroku train serve`: a new trainee with mouse, touch points and keys, on a real organ. Each test goes on
// where the one before ended.
import { type ChildProcess, execFile, spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import type { Browser, CDPSession, Page } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { keepPicture, seriousBarriers, startBrowser, story, until, visit, type Visitor } from './kit';
import { expectFits } from './layout';

const kiroku = process.env['KIROKU_PROGRAM'] as string;
const run = promisify(execFile);
/** One fingertip alone goes between the nodes of coarser meshes. */
const kVertices = '2000';

class Trainer {
  signIn = '';
  private constructor(
    private readonly folder: string,
    private readonly process: ChildProcess,
  ) {}

  static async start(): Promise<Trainer> {
    const folder = mkdtempSync(join(tmpdir(), 'kiroku-training-'));
    const home = join(folder, 'home');
    await run(kiroku, ['init', '--demo', '--home', home]);
    // An expert's hand that others follow: simulated, as nobody is at hand.
    await run(kiroku, ['train', 'exclusion', '--object', 'a', '--hand', 'simulated', '--vertices', kVertices, '-o', join(folder, 'expert'), '--size', '64x64']);
    const child = spawn(
      kiroku,
      [
        'train',
        'serve',
        '--home',
        home,
        '--listen',
        '127.0.0.1:0',
        '--vertices',
        kVertices,
        '--expert-a',
        join(folder, 'expert/hand.txt'),
        '--web',
        process.env['KIROKU_PAGE'] as string,
        '--practice',
        '0',
        '--seal',
        '--json',
      ],
      { stdio: ['ignore', 'pipe', 'inherit'] },
    );
    const trainer = new Trainer(folder, child);
    let said = '';
    child.stdout?.on('data', (bytes: Buffer) => (said += bytes.toString()));
    trainer.signIn = await until('kiroku train serve serves', () => {
      try {
        return (JSON.parse(said) as { sign_in: string }).sign_in;
      } catch {
        return undefined;
      }
    });
    return trainer;
  }
  /** What the sealed case of an attempt says of the training. */
  async sealed(id: string): Promise<Record<string, unknown>> {
    const home = join(this.folder, 'home');
    const opened = await run(kiroku, ['unseal', '-i', join(home, 'identity.txt'), join(home, 'archive', id, 'subject.json.age')]);
    return (JSON.parse(opened.stdout) as { training: Record<string, unknown> }).training;
  }
  async stop(): Promise<void> {
    const ended = new Promise((resolve) => this.process.once('exit', resolve));
    this.process.kill('SIGTERM');
    await ended;
    rmSync(this.folder, { recursive: true, force: true });
  }
}

let trainer: Trainer;
let browser: Browser;
let visitor: Visitor;
let touch: CDPSession;

beforeAll(async () => {
  trainer = await Trainer.start();
  browser = await startBrowser();
  visitor = await visit(browser);
  touch = await visitor.context.newCDPSession(visitor.page);
  await touch.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 5 });
});
afterAll(async () => {
  await browser?.close();
  await trainer?.stop();
});

const field = () => visitor.page.getByRole('application');
/** A place on the picture, 0 to 1 from its left upper corner, as one of the browser's window. */
const onPicture = async (x: number, y: number) => {
  // Where the attempt has ended, nothing is waited for.
  const box = (await field().evaluateAll((all) => all.map((one) => one.getBoundingClientRect().toJSON() as DOMRect)))[0];
  if (!box) throw new Error('there is no picture');
  return { x: box.x + x * box.width, y: box.y + y * box.height };
};
const fact = async (name: string): Promise<number> => {
  const texts = await visitor.page.locator('.attempt-facts > div', { hasText: name }).locator('dd').allTextContents();
  return Number.parseFloat(texts[0] ?? 'NaN');
};
const begun = () => visitor.page.locator('.attempt-field[aria-busy=false]').waitFor();
const isOver = async () => (await visitor.page.locator('.train-came').count()) > 0;

/** Lifts as a person does: until the line is in sight, then stays. Returns the largest forces of all fingers that were read meanwhile. */
async function lift(
  moveTo: (y: number) => Promise<void>,
  /** Once, when the organ is held: the line is not in sight then, so that the attempt does not end, however long somebody looks. */
  whenHeld?: () => Promise<void>,
  /** Again and again until the end. */
  glance?: () => Promise<void>,
  /** No further up than there. */
  top = 0.54,
): Promise<number[]> {
  let y = 0.66;
  let noted = false;
  const largest: number[] = [];
  const end = Date.now() + 50_000;
  while (!(await isOver()) && Date.now() < end) {
    const seen = await fact('Line in sight').catch(() => 100);
    if (seen < 97) y = Math.max(top, y - 0.002);
    await moveTo(y);
    const forces = await visitor.page
      .locator('.force .mono')
      .allTextContents()
      .catch(() => []);
    forces.forEach((text, i) => (largest[i] = Math.max(largest[i] ?? 0, Number(text))));
    if (!noted && seen < 97 && Number(forces[0] ?? 0) > 0.2) {
      noted = true;
      await whenHeld?.();
    }
    await glance?.();
    await visitor.page.waitForTimeout(15);
  }
  await visitor.page.locator('.train-came').waitFor();
  expect(noted || !whenHeld).toBe(true);
  return largest;
}

/** How many pixels of the picture are near a colour. */
const pixelsLike = (page: Page, red: number, green: number, blue: number): Promise<number> =>
  page.evaluate(
    ([r, g, b]) => {
      const canvas = document.querySelector('.attempt-field canvas') as HTMLCanvasElement;
      const { data } = (canvas.getContext('2d') as CanvasRenderingContext2D).getImageData(0, 0, canvas.width, canvas.height);
      let found = 0;
      for (let i = 0; i < data.length; i += 4) {
        const [pr = 0, pg = 0, pb = 0] = [data[i], data[i + 1], data[i + 2]];
        // Shading darkens, but keeps the ratio of the channels.
        const light = (pr + pg + pb) / (r + g + b);
        if (light > 0.25 && Math.abs(pr - light * r) + Math.abs(pg - light * g) + Math.abs(pb - light * b) < 40 * light) ++found;
      }
      return found;
    },
    [red, green, blue] as const,
  );

/** From now on the page keeps how many pixels of the newest picture are blue and red, and the most of any picture. */
const watchPictures = (page: Page): Promise<void> =>
  page.evaluate(() => {
    const seen = { most: { blue: 0, red: 0 }, now: { blue: 0, red: 0 } };
    (window as unknown as { seen: typeof seen }).seen = seen;
    const canvas = document.querySelector('.attempt-field canvas') as HTMLCanvasElement;
    const context = canvas.getContext('2d') as CanvasRenderingContext2D;
    const draw = context.drawImage.bind(context) as (...given: unknown[]) => void;
    (context as unknown as { drawImage: typeof draw }).drawImage = (...given) => {
      draw(...given);
      const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
      const now = { blue: 0, red: 0 };
      for (let i = 0; i < data.length; i += 4) {
        const [r = 0, g = 0, b = 0] = [data[i], data[i + 1], data[i + 2]];
        // Between both forces the colours are mixed. Nothing else of the picture has so little green.
        const strongest = Math.max(r, b);
        if (strongest < 60 || g > 0.2 * strongest) continue;
        if (b > 1.5 * r) ++now.blue;
        if (r > 1.5 * b) ++now.red;
      }
      seen.now = now;
      seen.most.blue = Math.max(seen.most.blue, now.blue);
      seen.most.red = Math.max(seen.most.red, now.red);
    };
  });
type Colours = { blue: number; red: number };
const coloursSeen = (page: Page): Promise<{ most: Colours; now: Colours }> =>
  page.evaluate(() => (window as unknown as { seen: { most: Colours; now: Colours } }).seen);

/** Fills in the questionnaire and the checklist of the attempt that is over. */
async function saysWhatItWas(page: Page): Promise<void> {
  await page.getByText('Nothing was said of this attempt yet.').waitFor();
  await page.getByText('Questionnaire on the trainer').click();
  const questionnaire = page.getByRole('form', { name: 'Questionnaire on the trainer' });
  await questionnaire.getByRole('button', { name: 'Keep' }).click();
  await page.getByText('Answer a question or write a comment first.').waitFor();
  await questionnaire.getByLabel('The trainer gives the feel of an organ.').selectOption('1');
  await questionnaire.getByLabel('It is useful to train pushing organs aside.').selectOption('2');
  await questionnaire.getByLabel('Comment').fill('The palm is missing.\nIt is heavy.');
  expect(await seriousBarriers(page)).toEqual([]);
  await questionnaire.getByRole('button', { name: 'Keep' }).click();
  await page.getByText('+1, +2, –').first().waitFor();
  await page.getByText('Examiner’s checklist').click();
  const checklist = page.getByRole('form', { name: 'Examiner’s checklist' });
  // The first choice is none: an item that was forgotten keeps the form from being sent.
  for (const select of await checklist.locator('select[name]:not([name=rating])').all()) await select.selectOption('done');
  await checklist.getByLabel('Does not let the organ slip').selectOption('not-done');
  await checklist.getByLabel('Looks where the border is before touching it').selectOption('not-seen');
  await checklist.getByLabel('Global rating').selectOption('4');
  await checklist.getByLabel('Examiner').fill('Dr Sato');
  expect(await seriousBarriers(page)).toEqual([]);
  await keepPicture(page, 'training-assessment');
  await checklist.getByRole('button', { name: 'Keep' }).click();
  await page.getByText('+1, +2, – · 6 of 7 done; rating 4 (Dr Sato)').first().waitFor();
}

story('A new trainee', (step) => {
  step('is added on the page, which shows nothing of recordings', async () => {
    const { page } = visitor;
    await page.goto(trainer.signIn);
    await page.getByRole('heading', { name: 'Push an organ aside' }).waitFor();
    await expect.poll(() => page.getByRole('link', { name: 'Cases' }).count()).toBe(0);
    await page.getByText('Nobody trains here yet.').waitFor();
    await page.locator('.train-add').getByLabel('Name').fill('Aoki');
    await page.getByRole('button', { name: 'Add', exact: true }).click();
    await page.getByText('Session 1: its first test ends it.').waitFor();
    await expectFits(visitor, 'training');
    await expect.poll(() => page.locator('.train-choice select').first().inputValue()).toBe('Aoki');
    await page.locator('.train-add').getByLabel('Name').fill('Aoki');
    await page.getByRole('button', { name: 'Add', exact: true }).click();
    await page.getByText("there is a trainee 'Aoki'").waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
  });

  step('finishes a task with the mouse and sees score and learning curve', async () => {
    const { page } = visitor;
    await page.getByRole('combobox', { name: 'Fingers' }).selectOption('3');
    await page.getByLabel('Show an expert’s hand').check();
    await expect.poll(() => page.getByLabel('Colour what the fingers press').isChecked()).toBe(false);
    await page.getByRole('button', { name: 'Practise' }).click();
    await begun();
    await expect.poll(() => page.locator('.press-scale').count()).toBe(0);
    await page.getByText('von Mises stress, kPa; 100 counts as damage').waitFor();
    // The picture has what is left of the screen: 220 pixels of its height are for the rest.
    const field = (await page.locator('.attempt-field').boundingBox()) as { height: number };
    expect(field.height).toBeGreaterThan(0.9 * ((page.viewportSize()?.height ?? 0) - 220));
    const start = await onPicture(0.5, 0.66);
    let latency = '';
    let ghost = 0;
    await page.mouse.move(start.x, start.y);
    await page.mouse.down();
    const forces = await lift(
      async (y) => {
        const to = await onPicture(0.5, y).catch(() => start);
        await page.mouse.move(to.x, to.y);
      },
      async () => {
        latency = (await page.locator('.attempt-latency').textContent()) ?? '';
        // Viridis at rest.
        expect(await pixelsLike(page, 68, 1, 84)).toBeGreaterThan(5000);
        expect(await seriousBarriers(page)).toEqual([]);
      },
      async () => {
        // The expert's hand is behind the organ until that is lifted too. The canvas is gone at the attempt's end.
        const seen = await pixelsLike(page, 120, 170, 255).catch(() => 0);
        if (ghost <= 50 && seen > 50) await keepPicture(page, 'training-attempt');
        ghost = Math.max(ghost, seen);
      },
    );
    await page.mouse.up();
    expect(ghost).toBeGreaterThan(50);
    expect(forces).toHaveLength(4);
    expect(Math.max(...forces)).toBeGreaterThan(1);
    await expect.poll(() => page.locator('.train-came').textContent()).toContain('Done');
    console.info(`As the page saw it, three fingers: ${latency}. ${await page.getByText('This machine:').textContent()}`);
    await expect.poll(() => page.locator('.train-came').textContent()).toMatch(/Largest von Mises stress, kPa\d+/);
    await page.getByRole('img', { name: 'Attempts of Aoki: Largest von Mises stress, kPa' }).waitFor();
    await page.getByText('The learning curve by session begins with the first test.').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
  });

  step('takes the test with five touch points, each a finger, and without stress', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Other trainee or organ' }).click();
    await page.getByRole('combobox', { name: 'Fingers' }).selectOption('5');
    await page.getByLabel('Show an expert’s hand').uncheck();
    await page.getByRole('button', { name: 'Take the test' }).click();
    await begun();
    await page.getByText('Stress is not shown in this attempt.').waitFor();
    const box = await field().boundingBox();
    if (!box) throw new Error('there is no picture');
    const points = (y: number) => [0.3, 0.4, 0.5, 0.6, 0.7].map((x, id) => ({ x: box.x + x * box.width, y: box.y + y * box.height, id }));
    await touch.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: points(0.66) });
    const forces = await lift(
      async (y) => void (await touch.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: points(y) })),
      async () => {
        expect(await pixelsLike(page, 68, 1, 84)).toBeLessThan(500);
        await keepPicture(page, 'training-touch');
      },
    );
    await touch.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
    expect(forces).toHaveLength(6);
    for (const force of forces.slice(0, 5)) expect(force).toBeGreaterThan(0.2);
    await expect.poll(() => page.locator('.train-came').textContent()).toContain('Done');
    await page.getByRole('img', { name: 'Tests by session: Largest von Mises stress, kPa' }).waitFor();
    await saysWhatItWas(page);
    await page.getByRole('button', { name: 'Seal this attempt' }).click();
    const told = page.getByText(/^Sealed as \d{8}T\d{6}Z-[0-9a-f]{8}\. Its verification says: intact\./);
    await told.waitFor();
    const id = /^Sealed as (\S+)\. /.exec((await told.textContent()) ?? '')?.[1] as string;
    expect(await trainer.sealed(id)).toMatchObject({ object: 'a', hand: 'page', friction: 0.5, damage_pa: 100e3, fingers: 5 });
    // What was said is in the case, and can only be read now.
    expect(await trainer.sealed(id)).toMatchObject({
      questionnaire: { answers: { 'organ-feel': 1, useful: 2, 'stress-helps': null }, comment: 'The palm is missing.\nIt is heavy.' },
      checklist: { items: { 'keeps-hold': 'not-done', 'looks-first': 'not-seen', 'lifts-steadily': 'done' }, global_rating: 4, examiner: 'Dr Sato' },
    });
    const said = page.getByRole('region', { name: 'What is said of it' });
    await said.getByText('Sealed with the attempt.').waitFor();
    await expect.poll(() => said.locator('form').count()).toBe(0);
    await said.getByText('The palm is missing.').waitFor();
    const certificate = await page.getByRole('link', { name: 'Certificate (PDF)' }).getAttribute('href');
    const answer = await visitor.context.request.get(new URL(certificate as string, trainer.signIn).href);
    expect(answer.status()).toBe(200);
    expect((await answer.body()).subarray(0, 5).toString()).toBe('%PDF-');
    expect(certificate).toMatch(/language=en$/);
    await keepPicture(page, 'training-result');
    // In the page's language.
    await page.getByRole('button', { name: '日本語' }).click();
    const japanese = await page.getByRole('link', { name: '証明書(PDF)' }).getAttribute('href');
    expect(japanese).toMatch(/language=ja$/);
    expect((await visitor.context.request.get(new URL(japanese as string, trainer.signIn).href)).status()).toBe(200);
    await page.getByRole('button', { name: 'English' }).click();
    await page.getByLabel('Measure').selectOption('time');
    await page.getByRole('img', { name: 'Tests by session: Time, s' }).waitFor();
    await expectFits(visitor, 'training-result');
    await touch.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 5 });
  });

  step('goes on with the next session after a test', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Other trainee or organ' }).click();
    await page.getByText('Session 2:').waitFor();
  });
  step('sees what a finger presses turn blue, then red', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: '日本語' }).click();
    await page.getByLabel('指で押している部分に色を付ける').check();
    await page.getByRole('button', { name: 'English' }).click();
    await page.getByRole('combobox', { name: 'Fingers' }).selectOption('2');
    await page.getByRole('button', { name: 'Practise' }).click();
    await begun();
    await page.getByText('Pressed tissue: blue at 0.5 N, red from 1.0 N on').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    expect((await pixelsLike(page, 255, 0, 0)) + (await pixelsLike(page, 0, 0, 255))).toBe(0);
    // Both fingers press upwards from below, a pixel at a time, until they are red. A force may rise too far from one picture to the next for blue to show:
    // then they yield while they are red, and press on where they are not.
    await watchPictures(page);
    let y = 0.66;
    const start = await onPicture(0.5, y);
    await page.mouse.move(start.x, start.y);
    await page.mouse.down();
    await expect
      .poll(
        async () => {
          const { most, now } = await coloursSeen(page);
          y += most.red > 100 && now.red > 0 ? 0.001 : -0.001;
          const to = await onPicture(0.5, y);
          await page.mouse.move(to.x, to.y);
          return most.blue > 20 && most.red > 100;
        },
        { timeout: 60_000, interval: 80 },
      )
      .toBe(true);
    await keepPicture(page, 'training-press');
    await page.mouse.up();
    await expect.poll(async () => (await pixelsLike(page, 255, 0, 0)) + (await pixelsLike(page, 0, 0, 255))).toBe(0);
    await page.getByRole('button', { name: 'Give up' }).click();
    await page.locator('.train-came', { hasText: 'Given up' }).waitFor();
    await page.getByRole('button', { name: 'Other trainee or organ' }).click();
    await page.getByLabel('Colour what the fingers press').uncheck();
  });

  step('lifts with retractors in trocars, in practice', async () => {
    const { page } = visitor;
    await page.getByRole('combobox', { name: 'With', exact: true }).selectOption('retractor');
    await page.getByRole('button', { name: 'Practise' }).click();
    await begun();
    await page.getByText('Instrument 2').waitFor();
    await page.getByText('Path of the tips').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    const start = await onPicture(0.5, 0.66);
    await page.mouse.move(start.x, start.y);
    await page.mouse.down();
    const forces = await lift(
      async (y) => {
        const to = await onPicture(0.5, y).catch(() => start);
        await page.mouse.move(to.x, to.y);
      },
      undefined,
      undefined,
      0.51,
    );
    await page.mouse.up();
    // Both instruments, the largest on a wall, all handles.
    expect(forces.length).toBe(4);
    expect(Math.min(...forces)).toBeGreaterThan(0.2);
    await page.locator('.train-numbers summary').click();
    await expect
      .poll(() => page.locator('.train-numbers tbody tr', { hasText: 'Retractors in trocars' }).allTextContents())
      .toEqual([expect.stringMatching(/^\d+Practice2Retractors in trocarsDone/)]);
    expect(await seriousBarriers(page)).toEqual([]);
    await page.getByRole('button', { name: 'Other trainee or organ' }).click();
    await page.getByRole('combobox', { name: 'With', exact: true }).selectOption('');
  });

  step('makes an attempt with keys alone, muted, and gives up', async () => {
    const { page } = visitor;
    await page.getByRole('combobox', { name: 'Fingers' }).selectOption('2');
    await page.getByRole('button', { name: 'Practise' }).click();
    await begun();
    await expect.poll(() => page.evaluate(() => document.activeElement?.getAttribute('role'))).toBe('application');
    await page.keyboard.press('Space');
    await page.waitForTimeout(700);
    for (let i = 0; i < 14; ++i) await page.keyboard.press('ArrowUp');
    await expect.poll(async () => Number((await page.locator('.force-all .mono').textContent()) ?? 0)).toBeGreaterThan(0.5);
    await page.keyboard.press('Space');
    await expect.poll(async () => Number((await page.locator('.force-all .mono').textContent()) ?? 1)).toBe(0);
    await page.getByRole('button', { name: 'Danger tone off' }).click();
    await page.getByRole('button', { name: 'Danger tone on' }).waitFor();
    await page.getByText(/Input to force [\d.]+ ms, to picture \d+ ms/).waitFor();
    await page.getByRole('button', { name: 'Give up' }).click();
    await page.locator('.train-came', { hasText: 'Given up' }).waitFor();
  });

  step('makes one with a gamepad', async () => {
    const { page } = visitor;
    // No gamepad can be plugged in here: the browser's own list of them is replaced, and nothing behind it.
    await page.evaluate(() => {
      const pad = { connected: true, mapping: 'standard', axes: [0, 0, 0, 0], buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })) };
      Object.assign(window, { pad });
      navigator.getGamepads = () => [pad as unknown as Gamepad];
    });
    const feel = (axes: number[], trigger: number) =>
      page.evaluate(
        ([sticks, value]) => {
          const { pad } = window as unknown as { pad: { axes: number[]; buttons: { pressed: boolean; value: number }[] } };
          pad.axes = sticks;
          pad.buttons[6] = { pressed: value > 0.5, value };
        },
        [axes, trigger] as const,
      );
    await page.getByRole('button', { name: 'Again' }).click();
    await begun();
    await expect.poll(() => page.locator('.pad-mark').count()).toBe(2);
    await feel([0, 0, 0, 0], 0.2);
    await page.locator('.pad-mark.key-mark-down').waitFor();
    await page.waitForTimeout(700);
    // The hand looks at the force in the page itself and stops there: seen from outside, a busy machine would let it pull on until the attempt is done.
    await page.evaluate(() => {
      const { pad } = window as unknown as { pad: { axes: number[] } };
      const watch = setInterval(() => {
        if (Number(document.querySelector('.force-all .mono')?.textContent ?? 0) <= 0.5) return;
        pad.axes = [0, 0, 0, 0];
        clearInterval(watch);
      }, 10);
    });
    await feel([0, -0.6, 0, 0], 0.2);
    await expect.poll(async () => Number((await page.locator('.force-all .mono').textContent()) ?? 0)).toBeGreaterThan(0.5);
    await feel([0, 0, 0, 0], 0);
    await expect.poll(async () => Number((await page.locator('.force-all .mono').textContent()) ?? 1)).toBe(0);
    await page.getByRole('button', { name: 'Give up' }).click();
    await page.locator('.train-came', { hasText: 'Given up' }).waitFor();
  });

  step('closes the page, and the attempt is kept as broken off', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Again' }).click();
    await begun();
    await page.reload();
    await page.getByRole('combobox', { name: 'Fingers' }).selectOption('5');
    await page.getByRole('button', { name: 'Results' }).click();
    await page.getByText('As numbers').click();
    await expect
      .poll(async () => {
        await page.getByRole('button', { name: 'Other trainee or organ' }).click();
        await page.getByRole('button', { name: 'Results' }).click();
        await page.getByText('As numbers').click();
        return page.locator('.train-numbers tbody tr').last().textContent();
      })
      .toContain('Broken off');
    await expect.poll(() => page.locator('.train-numbers tbody tr').allTextContents()).toHaveLength(7);
  });
  step('reads all of it in Japanese and in light colours', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: '日本語' }).click();
    await page.getByRole('button', { name: '明るい配色' }).click();
    await page.getByRole('heading', { name: '結果 · Aoki' }).waitFor();
    await page.getByRole('img', { name: 'Aoki さんの試行: 最大ミーゼス応力 kPa' }).waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'training-japanese');
  });

  step('asks nothing of anybody else, and nothing goes wrong', () => {
    const own = new URL(trainer.signIn).origin;
    expect(visitor.asked.filter((address) => !address.startsWith(own) && !address.startsWith('blob:') && !address.startsWith('data:'))).toEqual([]);
    // The name that was there already was refused with 400, which the browser writes down.
    expect(visitor.problems.filter((one) => !one.includes('status of 400'))).toEqual([]);
  });
});
