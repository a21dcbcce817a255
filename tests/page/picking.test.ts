// Points and tools picked on the page: a plan's own replay was recorded as if it were the endoscope's, so that where its camera was, and where each tool
// went, are known.
import { execFileSync } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Locator } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import type { ComparisonDocument, PickingCamera } from '@/api/types';
import { type OrganPoint, type Place, seenBy } from '@/compare/picks';
import { pictureBox } from '@/pointing/geometry';
import { Appliance, keepPicture, kMaking_ms, near, seriousBarriers, startBrowser, story, type Visitor, visitPlan } from './kit';
import { expectFits } from './layout';

const kWide = 320;
const kHigh = 240;
const kView = { azimuth_deg: 20, elevation_deg: 10, zoom: 1, pan_x: 0, pan_y: 0 };

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
let id = '';

const press = (key: string) => visitor.page.keyboard.press(key);
const matching = () => visitor.page.getByRole('region', { name: 'Match steps by hand' });
const work = (name: string) => matching().locator('.plan-choices').getByText(name, { exact: true });
const recorded = () => visitor.page.getByRole('application', { name: /in the picture of/ });
const planned = () => visitor.page.getByRole('application', { name: 'Pick points of the organ' });
const points = () => matching().locator('.pick-list li');
const goTo = async (seconds: number) => {
  await visitor.page.evaluate(() => (document.activeElement as HTMLElement | null)?.blur());
  await press('g');
  await visitor.page.locator('dialog input:focus').waitFor();
  await visitor.page.keyboard.type(seconds.toFixed(3));
  await press('Enter');
  await near(visitor.page, seconds);
};
/** The archived picture of that time is the one that is picked on. */
const shows = (seconds: number) => visitor.page.locator('.pick-pane .copy-label', { hasText: `00:00:0${seconds.toFixed(3)}` }).waitFor();
const onScreen = async (field: Locator, { x, y }: Place) => {
  const area = await field.boundingBox();
  if (!area) throw new Error('the picture is not to be seen');
  const box = pictureBox(area.width, area.height, kWide, kHigh);
  return { x: area.x + box.left + x * box.width, y: area.y + box.top + y * box.height };
};
const clickOn = async (field: Locator, place: Place) => {
  const { x, y } = await onScreen(field, place);
  await visitor.page.mouse.click(x, y);
};
const ask = (path: string, body: unknown) =>
  visitor.page.evaluate(
    async ([address, text]) => {
      const answer = await fetch(address as string, {
        method: 'POST',
        headers: { 'Content-Type': 'application/json', 'X-Kiroku-Request': '1' },
        body: text as string,
      });
      return (await answer.json()) as Record<string, unknown>;
    },
    [`/api/cases/${id}/${path}`, JSON.stringify(body)],
  );

/** All over the organ as it is seen from there. */
const kPlaces: Place[] = [
  { x: 0.3, y: 0.5 },
  { x: 0.42, y: 0.42 },
  { x: 0.45, y: 0.62 },
  { x: 0.56, y: 0.44 },
  { x: 0.62, y: 0.55 },
  { x: 0.7, y: 0.55 },
  { x: 0.36, y: 0.56 },
  { x: 0.5, y: 0.5 },
];
/** A finger that glides over the organ, which is so stiff and held so well that it stays where it is. */
const kGlide: { from: OrganPoint; to: OrganPoint } = { from: [-20, -42.8, 0], to: [5, -39.8, 0] };
const kPlan = {
  name: 'A finger glides over the lobe',
  volume: 'organ.nrrd',
  mesh: { threshold: [0, 300], vertices: 500 },
  length_unit: 'mm',
  time_step_s: 0.04,
  materials: [{ region: 'all', young_modulus_pa: 50_000, poisson_ratio: 0.45 }],
  fixed: [
    {
      box: [
        [-90, 8, -60],
        [90, 60, 60],
      ],
    },
  ],
  tools: { finger: { kind: 'finger', radius: 7 } },
  steps: [
    { do: 'hold', name: 'Look', duration_s: 1 },
    {
      do: 'press',
      name: 'Glide',
      tool: 'finger',
      path: [
        { at_s: 0, position: kGlide.from },
        { at_s: 2, position: kGlide.to },
      ],
    },
  ],
};
/** The recording ran as fast as the plan: where the finger is in its pictures. */
const kClicked_s = [1.08, 1.48, 2, 2.48, 2.92];
const tipAt = (seconds: number) => kGlide.from.map((from, axis) => from + ((seconds - 1) / 2) * ((kGlide.to[axis] as number) - from)) as unknown as OrganPoint;

beforeAll(async () => {
  appliance = await Appliance.alone();
  const folder = join(appliance.home, 'plans', 'demonstration');
  mkdirSync(folder, { recursive: true });
  const demonstration = join(process.env['KIROKU_SOURCE_DIR'] ?? '', 'deploy', 'demonstration');
  writeFileSync(join(folder, 'plan.json'), JSON.stringify(kPlan));
  writeFileSync(
    join(folder, 'organ.nrrd'),
    execFileSync('awk', ['-f', join(demonstration, 'organ.awk')], { env: { ...process.env, LC_ALL: 'C' }, maxBuffer: 1 << 24 }),
  );
  await appliance.kiroku('plan', 'seal', join(folder, 'plan.json'));
  const film = join(folder, 'replay.mp4');
  execFileSync(process.env['KIROKU_PROGRAM'] ?? '', [
    'plan',
    'replay',
    join(folder, 'plan.json'),
    '-o',
    film,
    '--gpu',
    'off',
    '--no-caption',
    '--size',
    `${kWide}x${kHigh}`,
    '--view',
    `${kView.azimuth_deg},${kView.elevation_deg}`,
  ]);
  id = await appliance.recordPlanned(join(folder, 'plan.seal.json'), 'endoscope', `${film}?speed=max`, 3000);
  browser = await startBrowser();
  visitor = await visitPlan(browser, appliance, id);
  await visitor.page.getByRole('button', { name: 'Match steps by hand' }).click();
  await matching().getByText('0 of 2 steps matched').waitFor();
});

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

story('What is said by hand', (step) => {
  step('has pauses that are added, listed, removed and undone', async () => {
    const { page } = visitor;
    // As they were recorded: each as fast as planned.
    for (const [step, start] of [
      ['1. Look', 0],
      ['2. Glide', 1],
    ] as const) {
      await matching().getByRole('button', { name: step, exact: true }).click();
      await goTo(start);
      await press('m');
    }
    await matching().getByText('2 of 2 steps matched').waitFor();
    const glide = matching().locator('li', { hasText: '2. Glide' });
    await goTo(1.5);
    await press('b');
    await glide.getByRole('button', { name: 'Goes on now: Glide' }).waitFor();
    await goTo(1.9);
    await press('b');
    await glide.getByText('pause 00:00:01.500 – 00:00:01.900').waitFor();
    await keepPicture(page, 'plan-pause');
    expect(await seriousBarriers(page)).toEqual([]);
    await glide.getByRole('button', { name: 'Remove the pause at 00:00:01.500' }).click();
    await expect.poll(() => glide.getByText(/^pause /).count()).toBe(0);
    await matching().getByRole('button', { name: 'Undo' }).click();
    await glide.getByText('pause 00:00:01.500').waitFor();
    await press('Control+z');
    await expect.poll(() => glide.getByText(/^pause /).count()).toBe(0);
    // From one step into another there is none.
    await goTo(0.8);
    await press('b');
    await goTo(1.2);
    await press('b');
    await page.getByText('A pause lies within one step that is matched').waitFor();
    await page.locator('.notices').getByRole('button', { name: 'Close' }).click();
  });

  step('says why there is no picture of the plan, and asks again', async () => {
    const { page } = visitor;
    await page.route('**/picking/picture', (route) =>
      route.fulfill({ status: 422, contentType: 'application/json', body: JSON.stringify({ error: 'the plan names no CT' }) }),
    );
    await goTo(0.32);
    await work('Points').click();
    await page.getByText('The plan’s picture could not be had: the plan names no CT').waitFor();
    await keepPicture(page, 'plan-points-failed');
    expect(await seriousBarriers(page)).toEqual([]);
    await page.unroute('**/picking/picture');
    await page.getByRole('button', { name: 'Try again' }).click();
    await planned().waitFor();
    await expect.poll(() => page.getByText('could not be had').count()).toBe(0);
    await work('Steps').click();
  });

  step('has points, picked in both pictures of a moment, with how well they register the camera', async () => {
    const { page } = visitor;
    await goTo(0.32);
    await work('Points').click();
    await shows(0.32);
    await matching().getByText('0 of at least 6 points picked on both sides').waitFor();
    await planned().waitFor();
    // Seen as the endoscope saw it.
    for (let i = 0; i < 4; ++i) await page.getByRole('button', { name: 'Turn left' }).click();
    for (let i = 0; i < 2; ++i) await page.getByRole('button', { name: 'Turn down' }).click();
    await page.waitForTimeout(1500);
    for (const place of kPlaces) {
      const before = await points().count();
      await clickOn(recorded(), place);
      await expect.poll(() => points().count()).toBe(before + 1);
      await points().nth(before).getByText('missing in the plan').waitFor();
      await clickOn(planned(), place);
      await expect.poll(() => points().nth(before).getByText('missing').count()).toBe(0);
    }
    await matching()
      .getByText(/The camera is found: 0\.\d\d pixels off by 8 points/)
      .waitFor();
    await page.mouse.move(5, 5);
    await keepPicture(page, 'plan-points');
    await expectFits(visitor, 'points');
    expect(await seriousBarriers(page)).toEqual([]);
  });

  step('lets points be moved, removed and brought back, by keys too', async () => {
    const { page } = visitor;
    const mark = recorded().getByRole('button', { name: 'Point 3 in the recording' });
    await mark.focus();
    for (let i = 0; i < 3; ++i) await press('Shift+ArrowRight');
    // Thirty pixels off: the camera cannot be where all are seen.
    await expect.poll(() => points().nth(2).textContent()).toMatch(/Point 3[1-9]\d*\.\d\d px off/);
    for (let i = 0; i < 3; ++i) await press('Control+z');
    await matching()
      .getByText(/The camera is found: 0\.\d\d pixels off by 8 points/)
      .waitFor();
    // Clicked on beside its middle, a mark is chosen and stays to the pixel where it was.
    const stands = await mark.boundingBox();
    const told = await points().nth(2).textContent();
    if (!stands) throw new Error('the mark is not to be seen');
    await page.mouse.click(stands.x + stands.width / 2 + 6, stands.y + stands.height / 2 - 5);
    await expect.poll(() => points().nth(2).getAttribute('class')).toBe('matching-chosen');
    expect(await mark.boundingBox()).toEqual(stands);
    await expect.poll(() => points().nth(2).textContent()).toBe(told);
    // All points are of one picture: no other takes its place.
    await page.evaluate(() => (document.activeElement as HTMLElement | null)?.blur());
    await press('.');
    await page.getByText('All points are of one picture').waitFor({ state: 'attached' });
    await shows(0.32);
    await mark.focus();
    await press('Delete');
    await expect.poll(() => points().count()).toBe(7);
    await press('Control+z');
    await expect.poll(() => points().count()).toBe(8);
    // A point that is dragged beside the organ in the plan's picture stays where it was.
    const inPlan = planned().getByRole('button', { name: 'Point 8 in the plan' });
    const from = await inPlan.boundingBox();
    const beside = await onScreen(planned(), { x: 0.02, y: 0.02 });
    if (!from) throw new Error('the mark is not to be seen');
    await page.mouse.move(from.x + from.width / 2, from.y + from.height / 2);
    await page.mouse.down();
    await page.mouse.move(beside.x, beside.y, { steps: 4 });
    await page.mouse.up();
    await expect.poll(async () => Math.round((await inPlan.boundingBox())?.x ?? 0)).toBe(Math.round(from.x));
    // Picked by keys alone: in the middle, and a pixel to the right.
    await recorded().focus();
    await press('ArrowRight');
    await press('ArrowRight');
    await press('Enter');
    await expect.poll(() => points().count()).toBe(9);
    await press('Control+z');
    await expect.poll(() => points().count()).toBe(8);
    // With two of eight left nothing can be kept, and it is said why.
    for (let i = 0; i < 6; ++i) await matching().getByRole('button', { name: 'Remove point 1' }).click();
    await matching().getByText('Too few points are picked on both sides').waitFor();
    await expect.poll(() => matching().getByRole('button', { name: 'Keep as a comparison' }).isDisabled()).toBe(true);
    for (let i = 0; i < 6; ++i) await press('Control+z');
    await matching()
      .getByText(/The camera is found: 0\.\d\d pixels off by 8 points/)
      .waitFor();
  });

  step('has clicks on tools, one a picture, that lead to their pictures', async () => {
    const { page } = visitor;
    await work('Tools').click();
    const view = { step: 1, plan_s: 0.32, ...kView, width: kWide, height: kHigh };
    const { camera } = (await ask('picking/picture', view)) as unknown as { camera: PickingCamera };
    for (const seconds of kClicked_s) {
      await goTo(seconds);
      await shows(seconds);
      const place = seenBy(camera, tipAt(seconds));
      if (!place) throw new Error('the tip is not before the camera');
      await clickOn(recorded(), place);
      await matching()
        .locator('.pick-list')
        .getByRole('button', { name: `00:00:0${seconds.toFixed(3)}`, exact: true })
        .waitFor();
    }
    await matching().getByText('5 clicks on its tip').waitFor();
    await clickOn(recorded(), { x: 0.1, y: 0.1 });
    await matching().getByText('5 clicks on its tip').waitFor();
    await press('Control+z');
    // The next picture of the recording has none.
    await page.evaluate(() => (document.activeElement as HTMLElement | null)?.blur());
    await press(',');
    await shows(2.88);
    await expect.poll(() => page.locator('.pick-mark').count()).toBe(0);
    await matching().locator('.pick-list').getByRole('button', { name: '00:00:02.000', exact: true }).click();
    await shows(2);
    await page.getByRole('button', { name: 'Click 3 on the tip of finger' }).waitFor();
    await page.mouse.move(5, 5);
    await keepPicture(page, 'plan-tools');
    expect(await seriousBarriers(page)).toEqual([]);
  });

  step('is kept: the camera is found, and the tool within a pixel of where it was planned', async () => {
    const { page } = visitor;
    await matching().getByRole('button', { name: 'Keep as a comparison' }).click();
    await page.getByText(/The camera was registered: 0\.\d\d pixels off by 8 points/).waitFor({ timeout: kMaking_ms });
    await page.getByText(/finger: \d\.\d pixels from its planned way on average/).waitFor();
    const document = await page.evaluate(async (one) => (await (await fetch(`/api/cases/${one}/comparisons/by-hand`)).json()) as ComparisonDocument, id);
    console.log(`picked on the page: camera ${document.registration?.rms_px.toFixed(3)} px, ${JSON.stringify(document.tools)}`);
    expect(document.registration?.rms_px).toBeLessThan(0.5);
    expect(document.registration?.error_px.length).toBe(8);
    const [finger] = document.tools;
    expect(finger?.tool).toBe('finger');
    expect(finger?.pictures).toBeGreaterThan(40);
    expect(finger?.mean_px).toBeLessThan(1);
    await keepPicture(page, 'plan-registered');
    expect(await seriousBarriers(page)).toEqual([]);
  });

  step('reads in Japanese and in light colours, without a serious barrier', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Match steps by hand' }).click();
    await matching().getByText('0 of 2 steps matched').waitFor();
    await page.getByRole('button', { name: 'Light colours' }).click();
    await page.getByRole('button', { name: '日本語' }).click();
    await page.getByText('点', { exact: true }).click();
    await page.getByText('先に手順を一つ対応付けてください').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'plan-points-japanese');
    expect(visitor.problems).toEqual([]);
    expect(visitor.asked.filter((one) => !one.startsWith(appliance.url) && !one.startsWith('blob:') && !one.startsWith('data:'))).toEqual([]);
  });
});
