// A breathing lung in a browser, before a real `kiroku respire serve` with a made-up chest and radiographs of a known breath: sliders, time line, undo; then the
// model that was saved breathes. Each test goes on where the one before ended.
import { type ChildProcess, execFile, spawn } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { promisify } from 'node:util';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { keepPicture, seriousBarriers, startBrowser, story, until, visit, type Visitor } from './kit';
import { expectFits } from './layout';

const kiroku = process.env['KIROKU_PROGRAM'] as string;
const run = promisify(execFile);

const kSize = [66, 52, 60] as const;
const kPhases = 12;
/** Three of 256 x 256 pixels and a third a second. */
const kRate = '3.333333';

let folder: string;
let server: ChildProcess;
let signIn: string;
let browser: Browser;
let visitor: Visitor;
const file = (name: string) => join(folder, name);

/** Ribs, a spine and a right lung in the shape of an upright ellipsoid, cut off below, with vessels and a tumour; voxels of 4 mm. */
function writeChest(): void {
  const [columns, rows, slices] = kSize;
  const hus = Buffer.alloc(2 * columns * rows * slices);
  const labels = Buffer.alloc(hus.length);
  let at = 0;
  for (let k = 0; k < slices; ++k) {
    for (let j = 0; j < rows; ++j) {
      for (let i = 0; i < columns; ++i, at += 2) {
        const [x, y, z] = [4 * i - 70, 4 * j - 104, 4 * k - 110];
        const lung = (x * x) / 1600 + (y * y) / 3600 + (z * z) / 6400 < 1 && z > -50;
        const tumour = lung && Math.hypot(x, y + 15, z + 25) < 15;
        const across = Math.hypot((x - 60) / 125, y / 95);
        let hu = across < 1 ? 20 : -1000;
        if (across > 0.88 && across < 1 && Math.sin(0.15 * (z + 0.3 * y)) > 0.4) hu = 600;
        if (Math.hypot(x - 62, y - 60) < 18) hu = 300 + 300 * Math.sin(0.19 * z);
        if (lung) hu = -820 + 350 * Math.max(Math.sin(0.09 * x + 0.04 * z) * Math.sin(0.07 * y + 0.03 * z) * Math.sin(0.06 * z - 0.05 * x), 0);
        if (tumour) hu = 30;
        hus.writeInt16LE(Math.trunc(hu), at);
        labels.writeInt16LE(tumour ? 2 : lung ? 1 : 0, at);
      }
    }
  }
  const head = (offset: string) =>
    `ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n` +
    `Offset = ${offset}\nElementSpacing = 4 4 4\nDimSize = ${kSize.join(' ')}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n`;
  writeFileSync(file('ct.mha'), Buffer.concat([Buffer.from(head('-140 -106 -110')), hus]));
  writeFileSync(
    file('labels.nrrd'),
    Buffer.concat([
      Buffer.from(
        `NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: ${kSize.join(' ')}\nspace directions: (4,0,0) (0,4,0) (0,0,4)\n` +
          `space origin: (-140,-106,-110)\nencoding: raw\nendian: little\n\n`,
      ),
      labels,
    ]),
  );
}
function writeModel(name: string, diaphragm: number): void {
  const breathing = { rib_cage: { amplitude: 2 }, diaphragm: { amplitude: diaphragm, phase_s: 0.6, direction: [0, 0, -1] } };
  writeFileSync(
    file(name),
    JSON.stringify({ name: 'Test', mesh: 'lung.msh', length_unit: 'mm', lung: 'right', tumour: { region: 2 }, phases: kPhases, breathing }),
  );
}

beforeAll(async () => {
  folder = mkdtempSync(join(tmpdir(), 'kiroku-breathing-'));
  writeChest();
  await run(kiroku, ['sim', 'mesh', file('labels.nrrd'), '--labels', file('labels.nrrd'), '--vertices', '600', '-o', file('lung.msh')]);
  writeModel('truth.json', 9);
  writeModel('guess.json', 3);
  writeFileSync(
    file('front.json'),
    JSON.stringify({ sad_mm: 1000, sid_mm: 1500, isocenter_mm: [-10, -2, 0], detector_px: [256, 256], detector_mm: [420, 420] }),
  );
  await run(kiroku, ['sim', 'respire', file('truth.json'), '-o', file('breathing')]);
  mkdirSync(file('xrays'));
  for (let phase = 0; phase < kPhases; ++phase) {
    const number = String(phase).padStart(5, '0');
    const displacement = join(file('breathing'), 'frames', `${number}.vtu`);
    await run(kiroku, [
      ...['sim', 'drr', file('ct.mha'), '-g', file('front.json'), '--mesh', file('lung.msh')],
      ...['--displacement', displacement, '-o', join(file('xrays'), `${number}.png`)],
    ]);
  }
  await run(kiroku, ['init', '--demo', '--home', file('home')]);
  server = spawn(
    kiroku,
    [
      ...['respire', 'serve', file('ct.mha'), file('guess.json'), '-g', file('front.json'), '--radiographs', file('xrays'), '--rate', kRate],
      ...['--home', file('home'), '--listen', '127.0.0.1:0', '--web', process.env['KIROKU_PAGE'] as string, '--json'],
    ],
    { stdio: ['ignore', 'pipe', 'inherit'] },
  );
  let said = '';
  server.stdout?.on('data', (bytes: Buffer) => (said += bytes.toString()));
  signIn = await until('kiroku respire serve serves', () => {
    try {
      return (JSON.parse(said) as { sign_in: string }).sign_in;
    } catch {
      return undefined;
    }
  });
  browser = await startBrowser();
  visitor = await visit(browser);
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

/** A sum of the picture's colours, which changes when it does. */
const picture = () =>
  visitor.page.evaluate(() => {
    const canvas = document.querySelector('.lung-field canvas') as HTMLCanvasElement;
    const { data } = (canvas.getContext('2d') as CanvasRenderingContext2D).getImageData(0, 0, canvas.width, canvas.height);
    return data.reduce((sum, value, i) => (sum + value * ((i % 251) + 1)) % 1_000_000_007, 0);
  });
const shape = () =>
  visitor.page.evaluate(() => {
    const { width, height } = document.querySelector('.lung-field canvas') as HTMLCanvasElement;
    return width / height;
  });
/** Waits for a picture of all pixels, after which no other comes by itself. */
const whole = () => expect.poll(() => visitor.page.locator('.lung-field canvas').getAttribute('data-rows')).toBe('256');
const slider = (name: string, who = visitor) => who.page.getByRole('slider', { name });
/** Mean and count of the radiographs that were measured. */
const measured = async () => {
  const text = (await visitor.page.locator('.lung-plot figcaption').nth(1).textContent()) ?? '';
  const [, mean, count] = /mean ([\d.-]+) of (\d+)\//.exec(text) ?? [];
  return { mean: Number(mean), count: Number(count ?? 0) };
};
const allMeasured = async () => {
  await expect.poll(async () => (await measured()).count).toBe(kPhases);
  return (await measured()).mean;
};
/** Waits for the measure of the sliders as they are: until it comes, that of before stands there. */
const comesTo = (mean: number) => expect.poll(async () => Math.abs((await allMeasured()) - mean)).toBeLessThan(0.0005);
const clock = async () => (await visitor.page.locator('.lung-clock').textContent()) ?? '';

story('A person who fits a breathing lung', (step) => {
  let before = 0;
  step('sees lung and radiograph beside each other, the path, and how alike they are', async () => {
    const { page } = visitor;
    await page.goto(signIn);
    await page.getByRole('heading', { name: 'Breathing lung' }).waitFor();
    await expect.poll(() => page.getByRole('link', { name: 'Cases' }).count()).toBe(0);
    await page.locator('.lung-field[aria-busy=false]').waitFor();
    await expect.poll(picture).not.toBe(0);
    await expect.poll(shape).toBeCloseTo(2, 5);
    before = await allMeasured();
    expect(before).toBeLessThan(0.99);
    await expect.poll(() => page.locator('.lung-plot polyline').count()).toBe(4);
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(visitor, 'breathing');
  });

  step('moves a slider until they agree, which the picture and the measure follow', async () => {
    const { page } = visitor;
    await page.setViewportSize({ width: 1280, height: 900 });
    const shown = await picture();
    await slider('Diaphragm: Amplitude').fill('9');
    await expect.poll(picture).not.toBe(shown);
    await expect.poll(allMeasured).toBeGreaterThan(Math.max(before + 0.005, 0.995));
    await keepPicture(page, 'breathing-by-hand');
  });

  step('undoes it and does it again, by keys and by buttons', async () => {
    const { page } = visitor;
    await page.keyboard.press('Control+z');
    await expect.poll(() => slider('Diaphragm: Amplitude').inputValue()).toBe('3');
    await comesTo(before);
    await page.getByRole('button', { name: 'Redo' }).click();
    await expect.poll(() => slider('Diaphragm: Amplitude').inputValue()).toBe('9');
    await expect.poll(() => page.getByRole('button', { name: 'Redo' }).isDisabled()).toBe(true);
  });

  step('drags two sliders, presses Fit, and sees the tumour followed and how far off it is', async () => {
    const { page } = visitor;
    await slider('Diaphragm: Amplitude').fill('4');
    await slider('Diaphragm: Phase').fill('0.2');
    await page.getByRole('button', { name: 'Fit', exact: true }).click();
    await page.getByRole('button', { name: 'Cancel' }).click();
    await page.getByText('the fit was cancelled').first().waitFor();
    await expect.poll(() => slider('Diaphragm: Amplitude').inputValue()).toBe('4');
    await page.getByRole('button', { name: 'Fit', exact: true }).click();
    await page
      .getByText(/^Found in/)
      .first()
      .waitFor();
    expect(Math.abs(Number(await slider('Diaphragm: Amplitude').inputValue()) - 9)).toBeLessThan(0.8);
    expect(Math.abs(Number(await slider('Diaphragm: Phase').inputValue()) - 0.6)).toBeLessThan(0.1);
    await expect.poll(allMeasured).toBeGreaterThan(0.99);
    const seen = /seen in (\d+) of 12/.exec((await page.getByText(/^The tumour was seen in/).textContent()) ?? '');
    expect(Number(seen?.[1])).toBeGreaterThan(8);
    await expect.poll(() => page.locator('.lung-plot circle.lung-point').count()).toBe(3 * Number(seen?.[1]));
    const off = async () => Number(/mean ([\d.]+) of/.exec((await page.locator('.lung-plot figcaption').nth(2).textContent()) ?? '')?.[1]);
    const fitted = await off();
    expect(fitted).toBeLessThan(1.5);
    await expect.poll(() => page.locator('.lung-found td.mono').first().textContent()).toMatch(/^[\d.-]+ ± [\d.]+$/);
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'breathing-fitted');
    // All of it is one step; with the sliders as before the tumour is further off.
    await page.getByRole('button', { name: 'Undo' }).click();
    await expect.poll(() => slider('Diaphragm: Amplitude').inputValue()).toBe('4');
    await page.getByText('The sliders were moved since.').waitFor();
    await expect.poll(off).toBeGreaterThan(fitted + 0.5);
    for (let i = 0; i < 2; ++i) await page.getByRole('button', { name: 'Undo' }).click();
    await expect.poll(() => slider('Diaphragm: Amplitude').inputValue()).toBe('9');
  });

  step('turns a direction with its sliders', async () => {
    const { page } = visitor;
    await page.getByLabel('Rib cage: Direction').selectOption('one');
    await slider('Rib cage: Towards head').fill('30');
    await slider('Rib cage: Left to back').fill('-120');
    await expect.poll(() => slider('Rib cage: Left to back').inputValue()).toMatch(/^-(120|119\.9)/);
    for (let i = 0; i < 3; ++i) await page.keyboard.press('Control+z');
    await expect.poll(() => page.getByLabel('Rib cage: Direction').inputValue()).toBe('normal');
  });

  step('lays one over the other, wipes, and subtracts, by buttons, keys and a drag', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Over' }).click();
    await expect.poll(shape).toBeCloseTo(1, 5);
    const half = await picture();
    await slider('Computed radiograph').fill('0.3');
    await expect.poll(picture).not.toBe(half);
    const pictures = new Set<number>();
    for (const key of ['w', 'd', 'c']) {
      await page.locator('.lung-field').focus();
      await whole();
      const last = await picture();
      await page.keyboard.press(key);
      await expect.poll(picture).not.toBe(last);
      await whole();
      pictures.add(await picture());
      if (key === 'd') await keepPicture(page, 'breathing-difference');
    }
    expect(pictures.size).toBe(3);
    await page.keyboard.press('w');
    const box = await page.locator('.lung-field canvas').boundingBox();
    if (!box) throw new Error('there is no picture');
    // The picture is square, and black is beside it: the edge follows the pointer.
    const part = 0.5 + (-0.08 * box.width) / Math.min(box.width, box.height);
    await page.mouse.move(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.42 * box.width, box.y + 0.5 * box.height, { steps: 4 });
    await page.mouse.up();
    await expect.poll(async () => Math.abs(Number(await slider('Edge').inputValue()) - part) < 0.02).toBe(true);
    const outlined = await picture();
    await page.getByLabel('Tumour’s outline').uncheck();
    await expect.poll(picture).not.toBe(outlined);
    await page.getByLabel('Tumour’s outline').check();
    await page.getByRole('button', { name: 'Beside' }).click();
  });

  step('plays, stops and steps from picture to picture', async () => {
    const { page } = visitor;
    await page.locator('.lung-field').focus();
    await page.keyboard.press('Space');
    const seen = new Set<string>();
    await expect
      .poll(async () => {
        seen.add(await clock());
        return seen.size;
      })
      .toBeGreaterThan(4);
    await page.getByRole('button', { name: 'Pause' }).click();
    await slider('Time').fill('0');
    await expect.poll(clock).toBe('0.00 s · 1/12');
    await page.locator('.lung-field').focus();
    await page.keyboard.press('ArrowRight');
    await expect.poll(clock).toBe('0.30 s · 2/12');
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('ArrowLeft');
    await expect.poll(clock).toBe('3.30 s · 12/12');
    await page.getByRole('button', { name: 'One picture on' }).click();
    await expect.poll(clock).toBe('0.00 s · 1/12');
  });

  step('turns the lung, paints and erases its groups, and saves what was painted', async () => {
    const { page } = visitor;
    await page.getByText('Groups of the surface').click();
    const surface = page.locator('.lung-surface');
    await surface.waitFor();
    await surface.scrollIntoViewIfNeeded();
    const seen = () => surface.evaluate((canvas: HTMLCanvasElement) => canvas.toDataURL());
    const nodes = async (name: string) => Number(/(\d+) nodes/.exec((await page.locator('.lung-brushes label', { hasText: name }).textContent()) ?? '')?.[1]);
    const drag = async (from: [number, number], ...through: [number, number][]) => {
      const box = await surface.boundingBox();
      if (!box) throw new Error('there is no surface');
      const at = ([x, y]: [number, number]) => [box.x + x * box.width, box.y + y * box.height] as const;
      await page.mouse.move(...at(from));
      await page.mouse.down();
      for (const place of through) await page.mouse.move(...at(place), { steps: 5 });
      await page.mouse.up();
    };
    const diaphragm = await nodes('Diaphragm');
    const free = await nodes('Erase');
    expect(diaphragm).toBeGreaterThan(10);
    expect(await seriousBarriers(page)).toEqual([]);
    // Without a brush a drag turns, and paints nothing.
    const front = await seen();
    await drag([0.5, 0.5], [0.6, 0.4]);
    await expect.poll(seen).not.toBe(front);
    expect(await nodes('Diaphragm')).toBe(diaphragm);
    // From the feet the diaphragm is what is seen: a stroke across it erases a part of it.
    await page.getByRole('button', { name: 'Feet' }).click();
    await page.getByLabel('Erase').check();
    await slider('Radius').fill('10');
    const shown = await picture();
    await drag([0.4, 0.5], [0.5, 0.5]);
    await expect.poll(() => nodes('Diaphragm')).toBeLessThan(diaphragm);
    const left = await nodes('Diaphragm');
    expect(left).toBeGreaterThan(0);
    expect(await nodes('Erase')).toBe(free + diaphragm - left);
    await expect.poll(() => page.locator('.lung-group legend', { hasText: 'Diaphragm' }).textContent()).toContain(`${left} nodes`);
    await expect.poll(picture).not.toBe(shown);
    await keepPicture(page, 'breathing-painted');
    // A stroke is one step.
    await page.keyboard.press('Control+z');
    await expect.poll(() => nodes('Diaphragm')).toBe(diaphragm);
    await page.keyboard.press('Control+Shift+z');
    await expect.poll(() => nodes('Diaphragm')).toBe(left);
    // What would leave nothing that moves is not painted.
    await slider('Radius').fill('50');
    await drag([0.3, 0.5], [0.7, 0.5], [0.5, 0.25], [0.5, 0.75]);
    await page.getByText('no node would be left of this group: Diaphragm').first().waitFor();
    expect(await nodes('Diaphragm')).toBe(left);
    // By keys: the cross in the middle, from the front.
    await page.getByRole('button', { name: 'Front' }).click();
    await page.getByLabel('Hilum').check();
    const hilum = await nodes('Hilum');
    await slider('Radius').fill('8');
    await surface.focus();
    await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('Enter');
    await expect.poll(() => nodes('Hilum')).toBeGreaterThan(hilum);
    await page.getByLabel('As the model had it').check();
    await surface.focus();
    await page.keyboard.press('Enter');
    await expect.poll(() => nodes('Hilum')).toBe(hilum);
    await page.keyboard.press('Control+s');
    await page.getByLabel('File, without .json').fill('painted');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText('Saved as painted.json.').first().waitFor();
    const saved = JSON.parse(readFileSync(file('painted.json'), 'utf8')) as { groups: { group: string; nodes: number[] }[] };
    expect(saved.groups.map(({ group, nodes: of }) => [group, of.length])).toEqual([['free', diaphragm - left]]);
    const { stdout } = await run(kiroku, ['sim', 'respire', file('painted.json'), '-o', file('painted')]);
    expect(stdout).toContain(`diaphragm ${left},`);
    for (let i = 0; i < 3; ++i) await page.getByRole('button', { name: 'Undo' }).click();
    await expect.poll(() => nodes('Diaphragm')).toBe(diaphragm);
    await page.getByText('Groups of the surface').click();
  });

  step('saves a model that breathes as the page shows it, and never over another', async () => {
    const { page } = visitor;
    await page.keyboard.press('Control+s');
    await page.getByLabel('File, without .json').fill('guess');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText("there is a file 'guess.json' already").waitFor();
    await page.keyboard.press('Control+s');
    await page.getByLabel('File, without .json').fill('by-hand');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText('Saved as by-hand.json.').first().waitFor();
    await run(kiroku, ['sim', 'respire', file('by-hand.json'), '-o', file('again')]);
    const paths = ['breathing', 'again'].map((one) =>
      readFileSync(join(file(one), 'tumour.csv'), 'utf8')
        .trim()
        .split(/\r?\n/)
        .slice(1),
    );
    const truth = (paths[0] ?? []).map((row) => row.split(',').map(Number));
    const found = (paths[1] ?? []).map((row) => row.split(',').map(Number));
    expect(found.length).toBe(kPhases);
    found.forEach((row, i) => row.forEach((value, j) => expect(Math.abs(value - (truth[i]?.[j] ?? NaN))).toBeLessThan(0.01)));
  });

  step('seals one as a plan, which holds and is in the log', async () => {
    const { page } = visitor;
    await page.keyboard.press('Control+s');
    await page.getByLabel('File, without .json').fill('planned');
    await page.getByLabel('Seal it as a plan').check();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page
      .getByText(/Saved as planned\.json, sealed in planned\.seal\.json\. Time-stamps: [1-9], all self-issued/)
      .first()
      .waitFor();
    const { stdout } = await run(kiroku, ['plan', 'verify', file('planned.seal.json'), '--home', file('home'), '--json']);
    const checks = (JSON.parse(stdout) as { checks: { about: string; answer: string }[] }).checks;
    expect(checks.filter(({ answer }) => answer !== 'holds')).toEqual([]);
    expect(checks.map(({ about }) => about)).toContain('log');
    // It has no steps that an operation could be compared with.
    await expect(run(kiroku, ['plan', 'check', file('planned.json')])).rejects.toThrow(/is a breathing lung, which has no steps/);
    await page.keyboard.press('Control+s');
    await page.getByLabel('File, without .json').fill('planned');
    await page.getByLabel('Seal it as a plan').check();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText("there is a file 'planned.json' already").waitFor();
  });

  step('lies on a tablet, and reads all of it in Japanese and in light colours', async () => {
    const { page } = visitor;
    await page.setViewportSize({ width: 820, height: 1180 });
    await expect
      .poll(() => page.evaluate(() => getComputedStyle(document.querySelector('.lung-body') as Element).gridTemplateColumns.split(' ').length))
      .toBe(1);
    await keepPicture(page, 'breathing-tablet-820');
    await page.getByRole('button', { name: '日本語' }).click();
    await page.getByRole('button', { name: '明るい配色' }).click();
    await page.getByRole('heading', { name: '呼吸する肺' }).waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'breathing-japanese');
  });

  step('is led there by the viewer of the home, with its sign-in', async () => {
    // The first page gives its place back.
    await visitor.page.evaluate(() => (location.hash = '#/users'));
    const view = spawn(kiroku, ['view', '--home', file('home'), '--listen', '127.0.0.1:0', '--web', process.env['KIROKU_PAGE'] as string, '--json'], {
      stdio: ['ignore', 'pipe', 'inherit'],
    });
    try {
      let told = '';
      view.stdout?.on('data', (bytes: Buffer) => (told += bytes.toString()));
      const address = await until('kiroku view serves', () => {
        try {
          return (JSON.parse(told) as { sign_in: string }).sign_in;
        } catch {
          return undefined;
        }
      });
      const other = await visit(browser);
      await other.page.goto(address);
      await other.page.getByRole('link', { name: 'Breathing' }).click();
      await other.page.locator('.lung-field[aria-busy=false]').waitFor();
      await slider('Diaphragm: Amplitude', other).fill('5');
      await expect.poll(() => other.page.getByRole('button', { name: 'Undo' }).isEnabled()).toBe(true);
      expect(other.problems).toEqual([]);
      await other.context.close();
    } finally {
      const ended = new Promise((resolve) => view.once('exit', resolve));
      view.kill('SIGTERM');
      await ended;
    }
  });

  step('asks nothing of anybody else, and nothing goes wrong', () => {
    const own = new URL(signIn).origin;
    expect(visitor.asked.filter((address) => !address.startsWith(own) && !address.startsWith('blob:') && !address.startsWith('data:'))).toEqual([]);
    expect(visitor.problems).toEqual([]);
  });
});
