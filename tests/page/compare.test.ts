// The plan beside the recording, on the viewer's page: a plan is sealed, a case recorded and marked by it, the two are compared, and a surgeon looks at them.
import { copyFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, afterEach, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import type { ComparisonDocument } from '@/api/types';
import { mapOfSteps } from '@/compare/matching';
import { planMap } from '@/compare/plan_map';
import { Appliance, clockOf, keepPicture, kMaking_ms, near, newTab, seriousBarriers, settled, startBrowser, story, visitSignedIn, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
let id = '';

const press = (key: string) => visitor.page.keyboard.press(key);
const wait = (seconds: number) => new Promise((resolve) => setTimeout(resolve, seconds * 1000));
/** Where the plan's film stands, in seconds of the plan. */
const planAt = () => visitor.page.evaluate(() => document.querySelector<HTMLVideoElement>('.pane-plan video, .plan-over video')?.currentTime ?? NaN);
const openPlanTab = async () => {
  await visitor.page.getByRole('tab', { name: 'Plan' }).click();
  await visitor.page.locator('table.steps').waitFor();
};
const stepButton = (name: string) => visitor.page.locator('table.steps').getByRole('button', { name });
/** Space and the slider's keys are the focused element's own. */
const leaveButton = () => visitor.page.evaluate(() => (document.activeElement as HTMLElement | null)?.blur());
const goTo = async (text: string) => {
  await press('g');
  await visitor.page.locator('dialog input:focus').waitFor();
  await visitor.page.keyboard.type(text);
  await press('Enter');
};

beforeAll(async () => {
  appliance = await Appliance.start();
  const folder = await appliance.sealPlan();
  await appliance.kiroku('case', 'start', '--plan', join(folder, 'plan.seal.json'));
  for (const [seconds, mark] of [
    [2, 'Grasp the edge'],
    [1, 'Lift'],
    [1.5, 'pause'],
    [1.5, 'resume'],
    [1.5, 'Inspect'],
    [2, 'Hold'],
    [3, 'Hold done'],
    [0.5, 'Out'],
  ] as const) {
    await wait(seconds);
    await appliance.kiroku('case', 'mark', mark);
  }
  await appliance.kiroku('case', 'stop');
  id = appliance.cases().at(-1) as string;
  await appliance.kiroku('compare', id, join(folder, 'plan.seal.json'), '--gpu', 'off', '--width', '240', '--made-by', 'Dr. Sato');
  copyFileSync(join(folder, 'plan.json'), join(folder, 'later.json'));
  await appliance.kiroku('compare', id, join(folder, 'later.json'), '--gpu', 'off', '--width', '64', '--name', 'later');
  await appliance.kiroku('compare', id, join(folder, 'plan.seal.json'), '--gpu', 'off', '--width', '240', '--name', 'newest', '--made-by', 'Dr. Mori');
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});

beforeEach(async () => {
  await newTab(visitor);
  const { page } = visitor;
  await page.goto(`${appliance.url}#/cases/${id}`);
  await page.locator('.pane-plan video').waitFor();
  await openPlanTab();
  await page.getByLabel('Comparison').selectOption('newest');
  await page.getByText(/Compared by Dr. Mori/).waitFor();
  await page.locator('.pane-plan video').waitFor();
  await settled(page);
  await leaveButton();
});

afterEach(() => {
  expect(visitor.problems).toEqual([]);
  expect(visitor.asked.filter((one) => !one.startsWith(appliance.url) && !one.startsWith('blob:'))).toEqual([]);
});

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

describe('The plan beside the recording', () => {
  it('is there when the case is opened, with the patient’s pressure and the steps on the time line', async () => {
    const { page } = visitor;
    await expect.poll(() => page.locator('video').count()).toBe(3);
    await page.getByRole('tab', { name: 'Vital signs' }).click();
    await leaveButton();
    await press('PageDown');
    await settled(page);
    await expect.poll(() => page.locator('.pane-step').textContent()).toBe('2. Grasp the edge');
    await expect.poll(() => page.locator('.vital', { hasText: 'ABP' }).textContent()).toMatch(/\d\d+\/\d\d+/);
    await expect.poll(() => page.locator('.lane-names').textContent()).toContain('Plan');
    await keepPicture(page, 'plan-mark');
    expect(await seriousBarriers(page)).toEqual([]);
  });

  it('says in words that it was sealed before the first picture, and how that is known', async () => {
    const { page } = visitor;
    await page.getByText('The plan was sealed before the first picture').click();
    await page.getByText(/The seal is entry \d+ of the appliance’s log/).waitFor();
    await page.getByText('The first entry of this case names the plan by its seal.').waitFor();
    await page.getByText(/The seal existed at .* says the authority embedded, self-issued/).waitFor();
    await page.getByText('The comparison is as it was made').waitFor();
    await page.getByText(/Compared by Dr. Mori/).waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
  });

  it('lists the steps, each leading to its moment', async () => {
    const { page } = visitor;
    await expect.poll(() => page.locator('table.steps caption').textContent()).toBe('4 of 6 steps found · in another order than planned');
    await expect.poll(() => page.locator('table.steps tbody tr').first().textContent()).toContain('not found in the recording');
    const rows = await page.locator('table.steps tbody tr').allTextContents();
    expect(rows[2]).toMatch(/3\. Lift2\.00:00:0[34].*planned 2\.0 s, paused 1\.\d s/);
    await stepButton('3. Lift').click();
    await settled(page);
    const lift = await clockOf(page);
    expect(lift).toBeGreaterThan(2.5);
    await expect.poll(() => page.locator('table.steps tr[aria-current=step] th').textContent()).toBe('3. Lift');
    await page.locator('.step-facts', { hasText: 'arterial pressure, mean' }).waitFor();
    await keepPicture(page, 'plan-steps');
    await expectFits(visitor, 'plan', async ({ width }) => {
      if (width > 900) return;
      // Nothing lies between the two that are compared.
      const box = async (selector: string) => (await page.locator(selector).boundingBox()) as { y: number; height: number };
      const endoscope = await box('.pane[data-stream=endoscope]');
      const plan = await box('.pane-plan');
      expect(plan.y - (endoscope.y + endoscope.height)).toBeGreaterThanOrEqual(0);
      expect(plan.y - (endoscope.y + endoscope.height)).toBeLessThan(20);
      expect((await box('.pane[data-stream=room]')).y).toBeGreaterThanOrEqual(plan.y);
    });
    expect(await seriousBarriers(page)).toEqual([]);
    // By keys, in the order they were done.
    await press('n');
    await settled(page);
    await expect.poll(() => page.locator('.pane-step').textContent()).toBe('6. Inspect');
    await press('p');
    await near(page, lift);
  });

  it('keeps the plan in step: as the time map says while it stands, is paused, and goes on', async () => {
    const { page } = visitor;
    const map = await page.evaluate(async (one) => {
      const document = (await (await fetch(`/api/cases/${one}/comparisons/newest`)).json()) as {
        time_map: { pieces: { step: number; knots: [number, number][] }[] };
      };
      return document.time_map.pieces;
    }, id);
    const lift = map.find((one) => one.step === 3)?.knots ?? [];
    expect(lift.length).toBe(4);
    const [from, pause, resume, to] = lift as [[number, number], [number, number], [number, number], [number, number]];
    const middle = (a: [number, number], b: [number, number]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] as const;
    for (const [plan_s, case_ns] of [middle(from, pause), middle(pause, resume), middle(resume, to), from]) {
      await goTo((case_ns / 1e9).toFixed(3));
      await settled(page);
      await expect.poll(planAt).toSatisfy((at: number) => Math.abs(at - plan_s) < 0.02, `${plan_s} s of the plan`);
    }
    // While it plays: within a picture of the plan.
    await stepButton('3. Lift').click();
    await settled(page);
    await leaveButton();
    await press('Space');
    const apart: number[] = [];
    const end_ms = Date.now() + 30_000;
    while ((await clockOf(page)) * 1e9 < to[1] - 3e8 && Date.now() < end_ms) {
      const { clock, plan } = await page.evaluate(() => ({
        clock: document.querySelector('.clock-now')?.textContent ?? '',
        plan: document.querySelector<HTMLVideoElement>('.pane-plan video')?.currentTime ?? NaN,
      }));
      const [, , seconds] = clock.split(':').map(Number);
      const at_ns = (seconds ?? NaN) * 1e9;
      const at = lift.findLast((one) => one[1] <= at_ns) ?? from;
      const next = lift[lift.indexOf(at) + 1] ?? at;
      const expected = next[1] > at[1] ? at[0] + ((at_ns - at[1]) / (next[1] - at[1])) * (next[0] - at[0]) : at[0];
      apart.push(Math.abs(plan - expected));
      await page.waitForTimeout(100);
    }
    await press('Space');
    apart.sort((a, b) => a - b);
    console.log(
      `plan while playing: ${apart.length} looks, in the middle ${((apart[apart.length >> 1] as number) * 1000).toFixed(0)} ms off, at most ${((apart.at(-1) as number) * 1000).toFixed(0)} ms`,
    );
    expect(apart.length).toBeGreaterThan(10);
    expect(apart[Math.floor(0.8 * apart.length)]).toBeLessThan(0.1);
  });

  it('lies over the recording, or is wiped across it, as one likes', async () => {
    const { page } = visitor;
    const over = page.locator('[data-stream=endoscope] .plan-over-picture');
    await page.getByText('Over', { exact: true }).click();
    await over.locator('video').waitFor();
    await expect.poll(() => page.locator('.pane-plan').count()).toBe(0);
    await page.getByLabel('Opacity of the plan').fill('0.3');
    expect(await over.evaluate((one) => getComputedStyle(one).opacity)).toBe('0.3');
    await page.getByText('The camera was not registered').waitFor();
    await settled(page);
    await keepPicture(page, 'plan-over');
    await leaveButton();
    await press('c');
    await page.locator('.plan-edge').waitFor();
    expect(await over.evaluate((one) => getComputedStyle(one).clipPath)).toMatch(/inset\(0px 70% 0px 0px\)/);
    expect(await seriousBarriers(page)).toEqual([]);
    await press('c');
    await expect.poll(() => page.locator('video').count()).toBe(2);
    await press('c');
    await page.locator('.pane-plan video').waitFor();
  });

  it('shows another comparison, and does not call sealed what was not', async () => {
    const { page } = visitor;
    await page.getByLabel('Comparison').selectOption('later');
    await page.getByText('Not the plan that was sealed for this case before the first picture').waitFor();
    await page.getByText('the case was recorded by another plan').waitFor();
    await page.getByText('the appliance log knows no seal of this plan').waitFor();
    await page.getByLabel('Comparison').selectOption('plan');
    await page.getByText(/Compared by Dr. Sato/).waitFor();
  });

  story('has steps matched by hand', (step) => {
    step('by key and by flag, back and forth, seen at once', async () => {
      const { page } = visitor;
      await page.getByRole('button', { name: 'Match steps by hand' }).click();
      const matching = page.getByRole('region', { name: 'Match steps by hand' });
      await matching.getByText('4 of 6 steps matched').waitFor();
      await expect.poll(() => page.locator('.step-flag').count()).toBe(4);
      await matching.getByRole('button', { name: '1. Approach', exact: true }).click();
      await goTo('1.2');
      await settled(page);
      await leaveButton();
      await press('m');
      await matching.getByText('5 of 6 steps matched').waitFor();
      await expect.poll(() => matching.locator('li').first().textContent()).toContain('00:00:01.200 – ');
      await expect.poll(() => page.getByRole('img', { name: 'Time map: 5 of 6 steps' }).locator('polyline').count()).toBe(5);
      // The plan's film follows what was matched: within the first step there was nothing before.
      await goTo('1.5');
      await settled(page);
      await expect.poll(planAt).toSatisfy((at: number) => at > 0.05 && at < 0.9);
      await press('Control+z');
      await matching.getByText('4 of 6 steps matched').waitFor();
      await expect.poll(planAt).toBeGreaterThan(0.95);
      await press('Control+Shift+z');
      await matching.getByText('5 of 6 steps matched').waitFor();

      const flag = page.getByRole('slider', { name: '2. Grasp the edge' });
      const before = Number(await flag.getAttribute('aria-valuenow'));
      const box = await flag.boundingBox();
      if (!box) throw new Error('the flag is not to be seen');
      await page.mouse.move(box.x + 3, box.y + 8);
      await page.mouse.down();
      await page.mouse.move(box.x + 23, box.y + 8, { steps: 5 });
      await page.mouse.up();
      const after = Number(await flag.getAttribute('aria-valuenow'));
      expect(after).toBeGreaterThan(before + 50);
      await flag.press('ArrowRight');
      await expect.poll(async () => Number(await flag.getAttribute('aria-valuenow'))).toBe(after + 100);
      await settled(page);
      await keepPicture(page, 'plan-matching');
      await expectFits(visitor, 'matching');
      expect(await seriousBarriers(page)).toEqual([]);
    });

    step('and kept as a new comparison under the user’s name', async () => {
      const { page } = visitor;
      const matching = page.getByRole('region', { name: 'Match steps by hand' });
      await expect.poll(() => matching.getByLabel('Name').inputValue()).toBe('by-hand');
      await matching.getByRole('button', { name: 'Keep as a comparison' }).click();
      await matching.getByRole('progressbar').waitFor();
      await page.getByText(/Compared by demo/).waitFor({ timeout: kMaking_ms });
      await page.getByText('The plan was sealed before the first picture').waitFor();
      await expect.poll(() => page.locator('table.steps caption').textContent()).toContain('5 of 6 steps found');
      await page.locator('.pane-plan video').waitFor();
      // What was seen before is what the server made: the page's time map is the document's.
      const document = await page.evaluate(async (one) => (await (await fetch(`/api/cases/${one}/comparisons/by-hand`)).json()) as ComparisonDocument, id);
      expect(mapOfSteps(document.steps)).toEqual(planMap(document));
      expect(document.steps[0]?.done?.start_ns).toBe(1.2e9);
      expect((JSON.parse(await appliance.kiroku('verify', id, '--json')) as { verdict: string }).verdict).toBe('intact');
    });
  });

  it('reads in Japanese and in light colours, without a serious barrier', async () => {
    const { page } = visitor;
    await page.getByRole('button', { name: 'Light colours' }).click();
    expect(await seriousBarriers(page)).toEqual([]);
    await page.getByRole('button', { name: '日本語' }).click();
    await page.getByText('計画は最初の映像より前に封印されました').waitFor();
    await settled(page);
    await keepPicture(page, 'plan-japanese');
    expect(await seriousBarriers(page)).toEqual([]);
    await page.getByRole('button', { name: 'English' }).click();
    await page.getByRole('button', { name: 'Dark colours' }).click();
  });
});
