// The plan's radiographs over the case's fluoroscopy, on the viewer's page. The fluoroscopy is the plan's own radiographs, of a patient who lay aside,
// recorded as if they were a fluoroscope's.
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, expect } from 'vitest';
import type { ComparisonDocument } from '@/api/types';
import { Appliance, keepPicture, kMaking_ms, near, seriousBarriers, settled, startBrowser, story, type Visitor, visitSignedIn } from './kit';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
let id = '';

const over = () => visitor.page.locator('[data-stream=fluoroscopy] .plan-over-picture');

beforeAll(async () => {
  appliance = await Appliance.alone();
  const folder = join(appliance.home, 'plans', 'demonstration');
  mkdirSync(folder, { recursive: true });
  const demonstration = join(process.env['KIROKU_SOURCE_DIR'] ?? '', 'deploy', 'demonstration');
  copyFileSync(join(demonstration, 'plan.json'), join(folder, 'plan.json'));
  writeFileSync(
    join(folder, 'organ.nrrd'),
    execFileSync('awk', ['-f', join(demonstration, 'organ.awk')], { env: { ...process.env, LC_ALL: 'C' }, maxBuffer: 1 << 24 }),
  );
  const seal = join(folder, 'plan.seal.json');
  await appliance.kiroku('plan', 'seal', join(folder, 'plan.json'));
  const geometry = (name: string, isocenter_mm: number[]) => {
    writeFileSync(join(folder, name), JSON.stringify({ sad_mm: 1000, sid_mm: 1500, isocenter_mm, detector_px: [256, 192], detector_mm: [384, 288] }));
    return join(folder, name);
  };
  const hand = join(folder, 'hand.json');
  const at = (seconds: number) => Math.round(seconds * 1e9);
  // As fast as planned: 1 s, 2 s, 1.5 s, 1 s.
  writeFileSync(
    hand,
    JSON.stringify({
      steps: [
        [1, 0, 1],
        [3, 1, 3],
        [4, 3, 4.5],
        [6, 4.5, 5.4],
      ].map(([step, start, end]) => ({ step, start: at(start as number), end: at(end as number) })),
    }),
  );
  const compare = (one: string, name: string, ...more: string[]) =>
    appliance.kiroku('compare', one, seal, '--by-hand', hand, '--gpu', 'off', '--width', '64', '--name', name, '--made-by', 'Dr. Sato', ...more);
  const record = (source: string) => appliance.recordPlanned(seal, 'fluoroscopy', source, 5500);
  const first = await record('synthetic:room?size=256x192&speed=max');
  await compare(first, 'film', '--geometry', geometry('lain.json', [-7, 0, 5]));
  const film = join(folder, 'xray.mp4');
  execFileSync(process.env['KIROKU_PROGRAM'] ?? '', [
    'unseal',
    '-i',
    join(appliance.home, 'identity.txt'),
    '-o',
    film,
    join(appliance.home, 'comparisons', first, 'film.radiographs.mp4.age'),
  ]);
  // Cases are named by the second.
  await new Promise((resolve) => setTimeout(resolve, 1100));
  id = await record(`${film}?speed=max`);
  await compare(id, 'xray', '--geometry', geometry('planned.json', [0, 0, 0]), '--align-at', '00:00:02');
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

story('The plan’s radiographs', (step) => {
  step('lie over the fluoroscopy in step, once one asks for them', async () => {
    const { page } = visitor;
    await page.locator('.case-link', { hasText: id }).click();
    await page.locator('.pane-plan video').waitFor();
    await page.getByRole('tab', { name: 'Plan' }).click();
    await expect.poll(() => page.getByText('Difference', { exact: true }).count()).toBe(0);
    await page.getByText('X-ray', { exact: true }).click();
    await page.getByText(/Fluoroscopy: the plan’s radiograph is alike by 0\.\d+/).waitFor();
    await page.getByText(/Aligned: 0\.9\d+; the patient lay \d+\.\d mm aside/).waitFor();
    await page.locator('.pane-plan video').waitFor();
    await page.getByRole('slider', { name: 'Position' }).focus();
    for (let i = 0; i < 2; ++i) await page.keyboard.press('Shift+ArrowRight');
    await settled(page);
    await keepPicture(page, 'xray-beside');
    await page.getByText('Over', { exact: true }).click();
    await over().locator('video').waitFor();
    await page.getByText('Difference', { exact: true }).click();
    await expect.poll(() => over().evaluate((one) => getComputedStyle(one).mixBlendMode)).toBe('difference');
    await expect.poll(() => page.getByLabel('Opacity of the plan').count()).toBe(0);
    await settled(page);
    await expect.poll(() => page.evaluate(() => document.querySelector<HTMLVideoElement>('.plan-over video')?.currentTime ?? NaN)).toBeCloseTo(2, 1);
    await keepPicture(page, 'xray-difference');
    // Nothing is pushed out of the window: the page has no bar to scroll it sideways.
    expect(await page.evaluate(() => [document.documentElement.scrollWidth <= innerWidth, scrollX])).toEqual([true, 0]);
    expect(await seriousBarriers(page)).toEqual([]);
  });

  step('give their place to the plan’s pictures again, which have no difference', async () => {
    const { page } = visitor;
    await page.getByText('Pictures', { exact: true }).click();
    await expect.poll(() => over().evaluate((one) => getComputedStyle(one).filter)).toContain('plan-key');
    await expect.poll(() => page.getByText('Difference', { exact: true }).count()).toBe(0);
    await page.getByText('The comparison is as it was made').click();
    await page.getByText('The film of the plan’s radiographs is the one that was made.').waitFor();
    await settled(page);
    await keepPicture(page, 'xray-pictures');
    expect(await seriousBarriers(page)).toEqual([]);
    expect(visitor.problems).toEqual([]);
  });

  step('are compared as the page says: a geometry of one’s own, aligned at a moment', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Match steps by hand' }).click();
    const matching = page.getByRole('region', { name: 'Match steps by hand' });
    for (const [step, start] of [
      ['1. Approach', 0],
      ['3. Lift', 1],
      ['4. Hold', 3],
      ['6. Inspect', 4.5],
    ] as const) {
      await matching.getByRole('button', { name: step, exact: true }).click();
      await page.evaluate(() => (document.activeElement as HTMLElement | null)?.blur());
      await page.keyboard.press('g');
      await page.locator('dialog input:focus').waitFor();
      await page.keyboard.type(String(start));
      await page.keyboard.press('Enter');
      await near(page, start);
      await page.keyboard.press('m');
    }
    await matching.locator('.plan-choices').getByText('X-ray', { exact: true }).click();
    const file = matching.getByLabel('Geometry (JSON)');
    await file.setInputFiles({ name: 'none.json', mimeType: 'application/json', buffer: Buffer.from('[1]') });
    await matching.getByText('none.json holds no geometry').waitFor();
    await file.setInputFiles(join(appliance.home, 'plans', 'demonstration', 'planned.json'));
    await matching.getByText('is compared, by planned.json').waitFor();
    await page.getByRole('slider', { name: 'Position' }).focus();
    await page.keyboard.press('Home');
    for (let i = 0; i < 2; ++i) await page.keyboard.press('Shift+ArrowRight');
    await matching.getByRole('button', { name: 'Align at this moment' }).click();
    await matching.getByText('00:00:02.000').waitFor();
    await keepPicture(page, 'xray-by-hand');
    expect(await seriousBarriers(page)).toEqual([]);
    await matching.getByRole('button', { name: 'Keep as a comparison' }).click();
    await page.getByText(/Aligned: 0\.9\d+; the patient lay \d+\.\d mm aside/).waitFor({ timeout: kMaking_ms });
    const made = await page.evaluate(async (one) => (await (await fetch(`/api/cases/${one}/comparisons/by-hand`)).json()) as ComparisonDocument, id);
    const moved_mm = made.fluoroscopy?.alignment?.translation_mm ?? [];
    console.log(`aligned on the page: ${JSON.stringify(made.fluoroscopy?.alignment)}`);
    expect(made.fluoroscopy?.stream).toBe('fluoroscopy');
    // The patient lay 7 mm and 5 mm aside, seen from the front.
    expect(Math.abs((moved_mm[0] ?? NaN) - 7)).toBeLessThan(1);
    expect(Math.abs((moved_mm[2] ?? NaN) + 5)).toBeLessThan(1);
    expect(visitor.problems).toEqual([]);
  });
});
