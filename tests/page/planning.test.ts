// Planning in a browser, before a real `kiroku plan serve` with the demonstration's organ: mouse, five touch points and keys; then the plan that was saved
// is checked and carried out. Each test goes on where the one before ended.
import { type ChildProcess, execFile, spawn } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import type { Browser, CDPSession } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { keepPicture, seriousBarriers, startBrowser, story, until, visit, type Visitor } from './kit';
import { expectFits } from './layout';

const kiroku = process.env['KIROKU_PROGRAM'] as string;
const demonstration = join(process.env['KIROKU_SOURCE_DIR'] as string, 'deploy/demonstration');
const run = promisify(execFile);

let folder: string;
let server: ChildProcess;
let signIn: string;
let browser: Browser;
let visitor: Visitor;
let touch: CDPSession;
const plans = () => join(folder, 'plans/lobe');

beforeAll(async () => {
  folder = mkdtempSync(join(tmpdir(), 'kiroku-planning-'));
  mkdirSync(plans(), { recursive: true });
  copyFileSync(join(demonstration, 'plan.json'), join(plans(), 'plan.json'));
  const organ = await run('awk', ['-f', join(demonstration, 'organ.awk')], { env: { ...process.env, LC_ALL: 'C' }, maxBuffer: 1 << 26 });
  writeFileSync(join(plans(), 'organ.nrrd'), organ.stdout);
  const home = join(folder, 'home');
  await run(kiroku, ['init', '--demo', '--home', home]);
  server = spawn(
    kiroku,
    [
      'plan',
      'serve',
      '--home',
      home,
      '--plans',
      join(folder, 'plans'),
      '--listen',
      '127.0.0.1:0',
      '--gpu',
      'off',
      '--web',
      process.env['KIROKU_PAGE'] as string,
      '--json',
    ],
    { stdio: ['ignore', 'pipe', 'inherit'] },
  );
  let said = '';
  server.stdout?.on('data', (bytes: Buffer) => (said += bytes.toString()));
  signIn = await until('kiroku plan serve serves', () => {
    try {
      return (JSON.parse(said) as { sign_in: string }).sign_in;
    } catch {
      return undefined;
    }
  });
  browser = await startBrowser();
  visitor = await visit(browser);
  touch = await visitor.context.newCDPSession(visitor.page);
  await touch.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 5 });
});
afterAll(async () => {
  await browser?.close();
  if (server) {
    const ended = new Promise((resolve) => server.once('exit', resolve));
    server.kill('SIGTERM');
    await ended;
  }
  rmSync(folder, { recursive: true, force: true });
});

const field = () => visitor.page.getByRole('application');
/** A place on the picture, 0 to 1 from its left upper corner, as one of the browser's window. */
const onPicture = async (x: number, y: number) => {
  const box = await field().boundingBox();
  if (!box) throw new Error('there is no picture');
  return { x: box.x + x * box.width, y: box.y + y * box.height };
};
const drag = async (...places: [number, number][]) => {
  const { page } = visitor;
  const [first, ...others] = await Promise.all(places.map(([x, y]) => onPicture(x, y)));
  if (!first) return;
  await page.mouse.move(first.x, first.y);
  await page.mouse.down();
  for (const { x, y } of others) await page.mouse.move(x, y, { steps: 10 });
};
const steps = () => visitor.page.locator('.planning-steps li').allTextContents();
const largest_Pa = async () => Number.parseFloat((await visitor.page.locator('.planning-stress dd').first().textContent()) ?? 'NaN');
const moved_mm = async () => Number.parseFloat((await visitor.page.locator('.planning-stress dd').nth(1).textContent()) ?? 'NaN');
/** A sum of the picture's colours, which changes when it does. */
const picture = () =>
  visitor.page.evaluate(() => {
    const canvas = document.querySelector('.planning-field canvas') as HTMLCanvasElement;
    const { data } = (canvas.getContext('2d') as CanvasRenderingContext2D).getImageData(0, 0, canvas.width, canvas.height);
    return data.reduce((sum, value, i) => (sum + value * ((i % 251) + 1)) % 1_000_000_007, 0);
  });

story('A person who plans', (step) => {
  step('finds the plans and begins anew on an organ', async () => {
    const { page } = visitor;
    await page.goto(signIn);
    await page.getByRole('heading', { name: 'Plan an operation' }).waitFor();
    await expect.poll(() => page.getByRole('link', { name: 'Cases' }).count()).toBe(0);
    await page.getByText('lobe/plan.json · Steps: 6').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(visitor, 'plans');
    await page.getByRole('button', { name: 'Begin anew' }).click();
    await page.locator('.planning-field[aria-busy=false]').waitFor();
    await expect.poll(picture).not.toBe(0);
    expect(await steps()).toEqual([]);
  });

  step('turns it with the mouse and with keys', async () => {
    const { page } = visitor;
    const before = await picture();
    await drag([0.5, 0.5], [0.53, 0.56]);
    await page.mouse.up();
    await expect.poll(picture).not.toBe(before);
    const turned = await picture();
    await page.keyboard.press('Home');
    await expect.poll(picture).not.toBe(turned);
  });

  /** Places on the picture from its middle outwards: where the organ's edge is thin enough for jaws depends on the view. */
  const kPlaces = [0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8].flatMap((x) => [0.5, 0.4, 0.6, 0.3, 0.7].map((y) => [x, y] as const));
  const fromBelow = async () => {
    await field().focus();
    for (let i = 0; i < 18; ++i) await visitor.page.keyboard.press('ArrowDown');
  };
  /** Whether the tool's jaws closed there; where it is too thick the page says so, and nothing is done. */
  const pressAt = async ([x, y]: readonly [number, number]): Promise<boolean> => {
    const { mouse } = visitor.page;
    const { x: left, y: top } = await onPicture(x, y);
    await mouse.move(left, top);
    await mouse.down();
    // Until a picture shows what came of it.
    await expect.poll(() => field().getAttribute('data-waits')).toBe('false');
    await mouse.up();
    return (await steps()).length > 0;
  };
  const apart_mm = async () => Number.parseFloat((await visitor.page.locator('.planning-jaws .muted').textContent()) ?? 'NaN');
  const undoAll = async () => {
    const done = (await steps()).length;
    for (let i = 0; i < done; ++i) await visitor.page.keyboard.press('Control+z');
    await expect.poll(steps).toEqual([]);
  };

  step('pinches it with jaws, closes them by keys and by a button, and undoes that', async () => {
    const { page } = visitor;
    // From below its edge points to who looks on.
    await fromBelow();
    await page.keyboard.press('j');
    for (const place of kPlaces) if (await pressAt(place)) break;
    await expect.poll(async () => (await steps()).join()).toMatch(/Close grasper 1/);
    const first_mm = await apart_mm();
    expect(first_mm).toBeGreaterThan(1);
    await field().focus();
    await page.keyboard.press('-');
    await expect.poll(apart_mm).toBeCloseTo(0.9 * first_mm, 0);
    await page.getByRole('button', { name: 'Close grasper 1 further' }).click();
    await expect.poll(apart_mm).toBeCloseTo(0.81 * first_mm, 0);
    await page.getByRole('button', { name: 'Open grasper 1 further' }).click();
    await expect.poll(apart_mm).toBeCloseTo(0.9 * first_mm, 0);
    expect(await page.locator('.planning-jaws').textContent()).toMatch(/squeeze [0-9.]+ N, pull [0-9.]+ of [0-9.]+ N/);
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'planning-jaws');
    await undoAll();
    await page.keyboard.press('o');
    await page.keyboard.press('Home');
  });

  /** A notice also goes by itself, so that none may be waited for. */
  const closeNotices = () =>
    expect
      .poll(async () => {
        const buttons = visitor.page.locator('.notice button');
        await buttons.evaluateAll((all) => all.forEach((button) => (button as HTMLButtonElement).click()));
        return buttons.count();
      })
      .toBe(0);

  step('clips it, and leaves the clip on', async () => {
    const { page } = visitor;
    await fromBelow();
    await page.keyboard.press('l');
    const stays = page.getByText(/Stays on, [0-9.]+ mm apart/);
    // Where it cannot be left, or friction does not hold it, the page says so: then another place is tried.
    for (const place of kPlaces) {
      if (!(await pressAt(place))) continue;
      expect((await steps()).join()).toMatch(/Close clip 1/);
      await field().focus();
      for (let i = 0; i < 4; ++i) {
        const before_mm = await apart_mm();
        await page.keyboard.press('-');
        await expect.poll(apart_mm).toBeLessThan(before_mm);
      }
      // What was said of places before is read.
      await closeNotices();
      await field().focus();
      await page.keyboard.press('Enter');
      await stays.or(page.locator('.notice')).first().waitFor();
      if ((await stays.count()) > 0) break;
      await undoAll();
    }
    await expect.poll(() => stays.count()).toBe(1);
    expect((await steps()).join()).toMatch(/Close clip 1.*Release clip 1/);
    await expect.poll(() => page.getByRole('button', { name: /clip 1/ }).count()).toBe(0);
    await undoAll();
    await page.keyboard.press('o');
    await page.keyboard.press('Home');
  });

  step('grasps it, pulls it, and sees what it moves and feels', async () => {
    const { page } = visitor;
    await page.keyboard.press('g');
    await drag([0.4, 0.62], [0.34, 0.72]);
    await expect.poll(moved_mm).toBeGreaterThan(8);
    await page.mouse.up();
    await expect.poll(async () => (await steps()).length).toBe(2);
    expect((await steps()).join()).toMatch(/Grasp with forceps.*Pull with forceps/);
    expect(Number(await page.locator('.planning-tool .mono').first().textContent())).toBeGreaterThan(0.01);
    expect(await largest_Pa()).toBeGreaterThan(50);
  });

  step('presses it with five touch points, each a finger', async () => {
    const { page } = visitor;
    await page.keyboard.press('p');
    await page.getByRole('slider', { name: 'Depth' }).fill('15');
    await page.getByLabel('Show von Mises stress').check();
    const box = await field().boundingBox();
    if (!box) throw new Error('there is no picture');
    const points = (dy: number) => [0.3, 0.4, 0.5, 0.6, 0.7].map((x, id) => ({ x: box.x + x * box.width, y: box.y + (0.49 + dy) * box.height, id }));
    await touch.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: points(0) });
    await expect.poll(async () => (await page.locator('.planning-tool').allTextContents()).filter((text) => text.startsWith('finger')).length).toBe(5);
    await touch.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: points(0.01) });
    await expect
      .poll(async () => {
        const forces = await page.locator('.planning-tool', { hasText: 'finger' }).locator('.mono').allTextContents();
        return forces.length === 5 && forces.every((force) => Number(force) > 0);
      })
      .toBe(true);
    await page.getByText(/Input to picture \d+ ms/).waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await page.waitForTimeout(600);
    await keepPicture(page, 'planning');
    console.info(`As the page saw it: ${await page.locator('.attempt-latency').textContent()}`);
    await touch.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
    await expect.poll(async () => await page.locator('.planning-tool').count()).toBe(1);
    expect((await steps()).join()).toMatch(/Press with finger 1, finger 2, finger 3, finger 4, finger 5/);
  });

  step('lies on a tablet, where two fingers turn, move and bring closer', async () => {
    const { page } = visitor;
    await expectFits(visitor, 'planning');
    await touch.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 5 });
    await page.keyboard.press('o');
    await page.setViewportSize({ width: 820, height: 1180 });
    await field().scrollIntoViewIfNeeded();
    const before = await picture();
    const fingers = (apart: number, y: number) =>
      Promise.all([onPicture(0.5 - apart, y), onPicture(0.5 + apart, y)]).then((both) => both.map((one, id) => ({ ...one, id })));
    await touch.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: await fingers(0.1, 0.5) });
    for (let step = 1; step <= 8; ++step)
      await touch.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: await fingers(0.1 + 0.03 * step, 0.5) });
    await touch.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
    await expect.poll(picture).not.toBe(before);
    // The page itself was neither scrolled nor zoomed by it.
    expect(await page.evaluate(() => visualViewport?.scale)).toBe(1);
    await page.keyboard.press('Home');
    await page.setViewportSize({ width: 1440, height: 900 });
  });

  step('cuts it along a line', async () => {
    const { page } = visitor;
    const before = (await steps()).length;
    await page.keyboard.press('c');
    await drag([0.62, 0.2], [0.6, 0.5], [0.6, 0.85]);
    await page.mouse.up();
    await expect.poll(async () => (await steps()).length).toBe(before + 1);
    expect((await steps()).at(-1)).toContain('Cut with scalpel');
    await page.waitForTimeout(600);
    await keepPicture(page, 'planning-cut');
  });

  step('undoes and does again', async () => {
    const { page } = visitor;
    const all = await steps();
    const shown = await picture();
    await page.keyboard.press('Control+z');
    await expect.poll(steps).toEqual(all.slice(0, -1));
    await expect.poll(picture).not.toBe(shown);
    await page.keyboard.press('Control+Shift+z');
    await expect.poll(steps).toEqual(all);
    await expect.poll(picture).toBe(shown);
  });

  const handle = (n: number) => visitor.page.getByRole('button', { name: new RegExp(`^Handle ${n} of \\d+ of the cut of step`) });
  const depthOf_mm = async (n: number) => Number(/, (\d+) mm deep/.exec((await handle(n).getAttribute('aria-label')) ?? '')?.[1]);
  /** Where the handle is on the picture, 0 to 1. */
  const placeOf = async (n: number): Promise<[number, number]> => {
    const [mark, box] = await Promise.all([handle(n).boundingBox(), field().boundingBox()]);
    if (!mark || !box) throw new Error('there is no such handle');
    return [(mark.x + mark.width / 2 - box.x) / box.width, (mark.y + mark.height / 2 - box.y) / box.height];
  };
  /** The picture once it is whole: while something moves it is smaller. */
  const still = async () => {
    let last: number | undefined;
    const isAsBefore = async () => {
      const before = last;
      last = await picture();
      return last === before;
    };
    await expect.poll(isAsBefore, { interval: 1_000, timeout: 30_000 }).toBe(true);
    return last;
  };
  const settled = () => expect.poll(() => field().getAttribute('data-waits')).toBe('false');

  step('draws an incision on the organ, and changes it by its handles: mouse, finger, keys and depth', async () => {
    const { page } = visitor;
    await page.keyboard.press('Control+z');
    await settled();
    const before = (await steps()).length;
    await page.keyboard.press('c');
    await page.getByRole('slider', { name: 'Depth of the cut' }).fill('12');
    await drag([0.42, 0.46], [0.5, 0.48], [0.58, 0.46]);
    await page.mouse.up();
    await expect.poll(async () => (await steps()).length).toBe(before + 1);
    await expect.poll(() => handle(1).count()).toBe(1);
    const all = await page.locator('.cut-handle').count();
    expect(all).toBeGreaterThanOrEqual(2);
    expect(await depthOf_mm(1)).toBe(12);
    expect(await seriousBarriers(page)).toEqual([]);
    const drawn = await still();
    const drawnAt = await placeOf(all);

    // By the mouse: the cut is made anew where the handle was dragged to, and no step is added.
    const from = await placeOf(all);
    await drag(from, [from[0] + 0.04, from[1] + 0.06]);
    await page.mouse.up();
    await settled();
    await expect.poll(async () => (await placeOf(all))[1]).toBeCloseTo(from[1] + 0.06, 1);
    await expect.poll(picture).not.toBe(drawn);
    expect((await steps()).length).toBe(before + 1);

    // By a finger.
    const first = await placeOf(1);
    const touched = async (x: number, y: number) => [{ ...(await onPicture(x, y)), id: 0 }];
    await touch.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: await touched(...first) });
    await touch.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: await touched(first[0] - 0.02, first[1] + 0.03) });
    await touch.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: await touched(first[0] - 0.03, first[1] + 0.06) });
    await touch.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
    await settled();
    await expect.poll(async () => (await placeOf(1))[1] - first[1]).toBeGreaterThan(0.03);

    // By keys: farther up, deeper, and made anew by Enter; Escape puts back.
    await handle(1).focus();
    const [, low] = await placeOf(1);
    for (const key of ['ArrowUp', 'ArrowUp', 'ArrowUp', 'PageUp', 'PageUp', 'PageUp', 'PageUp']) await page.keyboard.press(key);
    expect(await depthOf_mm(1)).toBe(16);
    await page.keyboard.press('Escape');
    expect(await depthOf_mm(1)).toBe(12);
    for (const key of ['ArrowUp', 'ArrowUp', 'ArrowUp', 'PageUp', 'PageUp', 'PageUp', 'PageUp', 'Enter']) await page.keyboard.press(key);
    await settled();
    await expect.poll(async () => low - (await placeOf(1))[1]).toBeGreaterThan(0.015);
    expect([await depthOf_mm(1), await depthOf_mm(2)]).toEqual([16, 12]);

    // By the slider, at the handle that is chosen.
    await page.getByRole('slider', { name: 'Depth at handle 1' }).fill('8');
    await settled();
    await expect.poll(() => depthOf_mm(1)).toBe(8);
    await closeNotices();
    const changed = await still();
    await keepPicture(page, 'planning-handles');

    // One at a time undone, and done again, with the slider still chosen; the whole plan has one step more than before.
    for (let i = 0; i < 4; ++i) await page.keyboard.press('Control+z');
    await settled();
    await expect.poll(() => depthOf_mm(1)).toBe(12);
    await expect.poll(() => placeOf(all)).toEqual(drawnAt);
    await expect.poll(picture).toBe(drawn);
    expect((await steps()).length).toBe(before + 1);
    for (let i = 0; i < 4; ++i) await page.keyboard.press('Control+Shift+z');
    await expect.poll(picture).toBe(changed);

    // Beside the organ: a sentence, and the cut as it was.
    const last = await placeOf(all);
    await drag(last, [0.02, 0.02]);
    await page.mouse.up();
    await page.getByText(`handle ${all} would leave the organ: drag it to a place on its surface`).first().waitFor();
    await settled();
    await expect.poll(async () => (await placeOf(all))[0]).toBeCloseTo(last[0], 2);
    await expectFits(visitor, 'planning-handles');
    await touch.send('Emulation.setTouchEmulationEnabled', { enabled: true, maxTouchPoints: 5 });
    await field().focus();
  });

  step('plans with keys alone', async () => {
    const { page } = visitor;
    const before = (await steps()).length;
    await page.keyboard.press('p');
    for (let i = 0; i < 5; ++i) await page.keyboard.press('ArrowUp');
    await page.keyboard.press('Space');
    await expect.poll(async () => await page.locator('.planning-tool').count()).toBe(2);
    await page.keyboard.press('Space');
    await expect.poll(async () => await page.locator('.planning-tool').count()).toBe(1);
    await page.keyboard.press('h');
    await expect.poll(async () => (await steps()).length).toBe(before + 3);
  });

  step('saves it as a new plan, which runs to where the page is', async () => {
    const { page } = visitor;
    const shown_mm = await moved_mm();
    const shown_Pa = await largest_Pa();
    await page.keyboard.press('Control+s');
    await page.getByLabel('File, without .json').fill('plan');
    await page.getByLabel('Name of the plan').fill('By hand');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText("there is a plan 'plan' already").waitFor();
    await page.keyboard.press('Control+s');
    await page.getByLabel('File, without .json').fill('by-hand');
    await page.getByLabel('Name of the plan').fill('By hand');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText('Saved as lobe/by-hand.json.').first().waitFor();
    const saved = join(plans(), 'by-hand.json');
    await run(kiroku, ['plan', 'check', saved]);
    await run(kiroku, ['plan', 'run', saved, '-o', join(folder, 'run')]);
    const rows = readFileSync(join(folder, 'run/stress.csv'), 'utf8').trim().split(/\r?\n/);
    const names = (rows[0] ?? '').split(',');
    const last = (rows.at(-1) ?? '').split(',');
    const of = (name: RegExp) => Number(last[names.findIndex((one) => name.test(one))]);
    expect(of(/displacement/)).toBeCloseTo(shown_mm, 0);
    expect(of(/mises/)).toBeCloseTo(shown_Pa, 0);
  });
  step('opens the new plan, and reads all of it in Japanese and in light colours', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Close the plan' }).click();
    await page.getByRole('button', { name: 'Go on with lobe/by-hand.json' }).click();
    await page.locator('.planning-field[aria-busy=false]').waitFor();
    await page.getByRole('button', { name: '日本語' }).click();
    await page.getByRole('button', { name: '明るい配色' }).click();
    await page.getByRole('toolbar', { name: '道具' }).waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'planning-japanese');
  });

  step('asks nothing of anybody else, and nothing goes wrong', () => {
    const own = new URL(signIn).origin;
    expect(visitor.asked.filter((address) => !address.startsWith(own) && !address.startsWith('blob:') && !address.startsWith('data:'))).toEqual([]);
    expect(visitor.problems).toEqual([]);
  });
});
