// From a recorded case's fluoroscopy to a sealed breathing model, as a new user goes: the case's page, two sliders, Fit, the tumour followed and the error
// plotted, the seal. The fluoroscopy is the demonstration's; the patient in it has another mesh than the lung that is fitted, and no breath like the other.
import { execFile } from 'node:child_process';
import { copyFileSync, cpSync, readdirSync, readFileSync, renameSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { promisify } from 'node:util';
import type { Browser, Locator } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import { Appliance, keepPicture, seriousBarriers, startBrowser, story, visitSignedIn, type Visitor } from './kit';
import { expectFits } from './layout';

const run = promisify(execFile);
const kiroku = process.env['KIROKU_PROGRAM'] as string;

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
let id = '';
let second = '';
const chest = (name: string) => join(appliance.home, 'chest', name);
const serve = (...parameters: string[]) => [chest('ct.nrrd'), chest('lung.json'), '--case', id, ...parameters];
/** How many pictures a second are taken: as many as a slow machine fits in seconds. */
const kRate = 3;
const kSeconds = 14;
const kPictures = kSeconds * kRate;

/** `kiroku sim respire`'s table: how far the tumour goes along an axis. */
function reach(csv: string, column: number): number {
  const values = readFileSync(csv, 'utf8')
    .trim()
    .split(/\r?\n/)
    .slice(1)
    .map((row) => Number(row.split(',')[column]));
  return Math.max(...values) - Math.min(...values);
}

beforeAll(async () => {
  appliance = await Appliance.alone();
  await run(join(process.env['KIROKU_SOURCE_DIR'] as string, 'deploy/demonstration/chest/make_fluoroscopy'), [join(appliance.home, 'chest')], {
    env: { ...process.env, PATH: `${dirname(kiroku)}:${process.env['PATH'] ?? ''}` },
  });
  const record = async (): Promise<string> => {
    const before = appliance.cases();
    await appliance.kiroku('record', '--fluoroscopy', `${chest('fluoroscopy.mkv')}?speed=max`, '--duration', `${kSeconds}s`);
    return appliance.cases().find((one) => !before.includes(one)) as string;
  };
  id = await record();
  second = await record();
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});
afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

const slider = (name: string) => visitor.page.getByRole('slider', { name });
const valueOf = async (one: Locator) => Number(await one.inputValue());
/** By the mouse, from where it stands; to where that value about is. */
async function drag(one: Locator, to: number): Promise<void> {
  await one.scrollIntoViewIfNeeded();
  const box = await one.boundingBox();
  if (!box) throw new Error('there is no slider');
  const [least, most] = [Number(await one.getAttribute('min')), Number(await one.getAttribute('max'))];
  // The thumb's middle goes from half of it behind the left end to half of it before the right.
  const thumb = 16;
  const x = (value: number) => box.x + thumb / 2 + ((box.width - thumb) * (value - least)) / (most - least);
  const y = box.y + box.height / 2;
  const { mouse } = visitor.page;
  await mouse.move(x(await valueOf(one)), y);
  await mouse.down();
  await mouse.move(x(to), y, { steps: 5 });
  await mouse.up();
}
const caption = async (at: number) => (await visitor.page.locator('.lung-plot figcaption').nth(at).textContent()) ?? '';

story('A person who comes from a case’s fluoroscopy', (step) => {
  step('is told what is missing before anything is served', async () => {
    const refused = (...parameters: string[]) => expect(run(kiroku, ['respire', 'serve', ...parameters, '--home', appliance.home])).rejects;
    await refused(...serve()).toThrow(
      /nothing says how the fluoroscope of 'fluoroscopy' saw the patient: give --geometry, or put .*fluoroscopy\.geometry\.json there/,
    );
    copyFileSync(chest('c-arm.json'), join(appliance.home, 'fluoroscopy.geometry.json'));
    await refused(...serve('--stream', 'events')).toThrow(/stream 'events' has no pictures/);
    await refused(...serve('--radiographs', 'film.mkv')).toThrow(/--radiographs and --case are two series/);
    await refused(chest('ct.nrrd'), chest('lung.json'), '--stream', 'fluoroscopy').toThrow(/say something of --case/);
    await refused(chest('ct.nrrd'), chest('lung.json')).toThrow(/without --case nothing says how the patient is seen/);
    writeFileSync(chest('wide.json'), readFileSync(chest('c-arm.json'), 'utf8').replace('[256, 256]', '[320, 256]'));
    await refused(...serve('-g', chest('wide.json'))).toThrow(/the picture of fluoroscopy at 00:00:00\S* has 256 x 256 pixels, the geometry says 320 x 256/);
    await refused(chest('ct.nrrd'), chest('c-arm.json'), '--case', id).toThrow(/c-arm\.json/);
    // The page would show a copy as the case of this name, and the log would name it so.
    cpSync(join(appliance.home, 'archive', id), join(appliance.home, 'copy', id), { recursive: true });
    await refused(chest('ct.nrrd'), chest('lung.json'), '--case', join(appliance.home, 'copy', id)).toThrow(/is no case of this home's archive/);
    // Of all this nothing was opened, and so the log says nothing but of the picture that did not fit.
    const { stdout: log } = await run(kiroku, ['log', '--home', appliance.home]);
    expect(log.match(/to fit a breathing lung/g)).toHaveLength(1);
    // What is read is compared with the ledger.
    const segments = join(appliance.home, 'archive', id, 'segments/fluoroscopy');
    const segment = join(segments, readdirSync(segments).sort()[1] as string);
    const kept = readFileSync(segment);
    const changed = Buffer.from(kept);
    changed[changed.length >> 1] = (changed[changed.length >> 1] as number) ^ 1;
    renameSync(segment, `${segment}.kept`);
    writeFileSync(segment, changed);
    await refused(...serve()).toThrow(/00000001\.ts\.age/);
    renameSync(`${segment}.kept`, segment);
    // Without the key nobody sees it.
    const identity = join(appliance.home, 'identity.txt');
    renameSync(identity, `${identity}.kept`);
    await refused(...serve()).toThrow(/identity/);
    renameSync(`${identity}.kept`, identity);
  });

  step('finds the way at its pane, and hears what has to be started', async () => {
    const { page } = visitor;
    await page.locator('.case-link', { hasText: id }).click();
    await page.locator('[data-stream=fluoroscopy]').getByRole('link', { name: 'Fit the breathing' }).click();
    await page.getByRole('heading', { name: 'Breathing does not run now.' }).waitFor();
    await appliance.serveBreathing(...serve('--rate', String(kRate)));
    // By itself.
    await page.getByRole('heading', { name: 'Breathing lung' }).waitFor();
    await page.locator('.lung-field[aria-busy=false]').waitFor();
    await expect.poll(() => page.locator('.crumbs').textContent()).toBe(`${id}/Fluoroscopy, from 00:00:00 of the case`);
    await expect.poll(async () => (await page.locator('.lung-clock').textContent()) ?? '').toMatch(new RegExp(` · 1/${kPictures}$`));
  });

  step('drags two sliders, and the pictures become more alike', async () => {
    const mean = async () => {
      const [, value, count] = /mean ([\d.-]+) of (\d+)\//.exec(await caption(1)) ?? [];
      return Number(count) === kPictures ? Number(value) : NaN;
    };
    await expect.poll(mean, { timeout: 120_000 }).toBeGreaterThan(0);
    const before = await mean();
    await drag(slider('Waveform: Breath'), 4.2);
    expect(Math.abs((await valueOf(slider('Waveform: Breath'))) - 4.2)).toBeLessThan(0.4);
    await drag(slider('Diaphragm: Amplitude'), 7);
    expect(Math.abs((await valueOf(slider('Diaphragm: Amplitude'))) - 7)).toBeLessThan(1);
    await expect.poll(mean, { timeout: 120_000 }).toBeGreaterThan(before);
  });

  step('presses Fit, and sees the tumour followed and the error plotted', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Fit', exact: true }).click();
    await page
      .getByText(/^Found in/)
      .first()
      .waitFor({ timeout: 600_000 });
    expect(Math.abs((await valueOf(slider('Waveform: Breath'))) - 4.2)).toBeLessThan(0.1);
    expect(Math.abs((await valueOf(slider('Diaphragm: Amplitude'))) - 7)).toBeLessThan(0.7);
    const seen = Number(/seen in (\d+) of/.exec((await page.getByText(/^The tumour was seen in/).textContent()) ?? '')?.[1]);
    expect(seen).toBeGreaterThan(0.8 * kPictures);
    await expect.poll(() => page.locator('.lung-plot circle.lung-point').count()).toBe(3 * seen);
    const off = Number(/mean ([\d.]+) of/.exec(await caption(2))?.[1]);
    // No sine is the patient's breath: the error is there to be seen, and small.
    expect(off).toBeGreaterThan(0.05);
    expect(off).toBeLessThan(1.5);
    expect(await seriousBarriers(page)).toEqual([]);
    await page.setViewportSize({ width: 1280, height: 900 });
    await page.evaluate(() => scrollTo(0, 0));
    await page.getByRole('slider', { name: 'Time' }).fill('5');
    await expect.poll(() => page.locator('.lung-clock').textContent()).toMatch(/^5\.00 s/);
    await expect.poll(() => page.locator('.lung-field canvas').getAttribute('data-rows')).toBe('256');
    // All ways and switches are in sight, though there is one more of them than without a workbench.
    const out = page.getByRole('button', { name: 'Sign out' });
    expect(await out.evaluate((one) => one.getBoundingClientRect().right - innerWidth)).toBeLessThanOrEqual(0);
    await keepPicture(page, 'breathing');
    await expectFits(visitor, 'fluoroscopy');
  });

  step('seals it, and what is sealed holds and breathes as the patient does', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Save as…' }).click();
    await page.getByLabel('File, without .json').fill('fitted');
    await page.getByLabel('Seal it as a plan').check();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page
      .getByText(/Saved as fitted\.json, sealed in fitted\.seal\.json\. Time-stamps: [1-9], all self-issued/)
      .first()
      .waitFor();
    const { checks } = JSON.parse(await appliance.kiroku('plan', 'verify', chest('fitted.seal.json'), '--json')) as {
      checks: { about: string; answer: string }[];
    };
    expect(checks.filter(({ answer }) => answer !== 'holds')).toEqual([]);
    await run(kiroku, ['sim', 'respire', chest('fitted.json'), '-o', chest('again')]);
    const head = 3;
    expect(Math.abs(reach(join(chest('again'), 'tumour.csv'), head) - reach(chest('patient-tumour.csv'), head))).toBeLessThan(2);
    const log = readFileSync(join(appliance.home, 'archive/log/ledger.jsonl'), 'utf8');
    expect(log).toContain('opened fluoroscopy to fit a breathing lung');
    expect(log).toContain(`opened lung lung.json with its CT and ${kPictures} radiographs of its fluoroscopy`);
  });

  step('goes back to the case, and from another case hears that its pictures are not open', async () => {
    const { page } = visitor;
    await page.locator('.crumbs a').click();
    await page.locator('[data-stream=fluoroscopy]').waitFor();
    await page.getByRole('link', { name: 'Cases', exact: true }).first().click();
    await page.locator('.case-link', { hasText: second }).click();
    await page.locator('[data-stream=fluoroscopy]').getByRole('link', { name: 'Fit the breathing' }).click();
    await page.getByRole('heading', { name: 'The workbench has other radiographs open.' }).waitFor();
    await page.getByText(`kiroku respire serve CT LUNG.json --case ${second} --stream fluoroscopy`).waitFor();
    await expect.poll(() => page.locator('.lung-field').count()).toBe(0);
    expect(await seriousBarriers(page)).toEqual([]);
    await page.getByRole('link', { name: 'To what is open' }).click();
    await page.locator('.lung-field[aria-busy=false]').waitFor();
    expect(visitor.problems).toEqual([]);
  });
});
