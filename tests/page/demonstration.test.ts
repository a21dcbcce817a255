// The way of a new user through what deploy/demo made, by nothing but what the page shows: a mark, the patient's pressure at it, the plan beside it, the
// verdict. KIROKU_DEMONSTRATION=build/demo says where that is; the README's pictures are made so.
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect } from 'vitest';
import { Appliance, keepPicture, seriousBarriers, settled, startBrowser, story, visit, type Visitor } from './kit';

const demonstration = process.env['KIROKU_DEMONSTRATION'];

describe.skipIf(!demonstration)('A new user of the demonstration', () => {
  let appliance: Appliance;
  let browser: Browser;
  let visitor: Visitor;

  beforeAll(async () => {
    appliance = await Appliance.show(join(demonstration as string, 'home'));
    browser = await startBrowser();
    visitor = await visit(browser);
  });
  afterAll(async () => {
    await browser?.close();
    await appliance?.stop();
  });

  story('comes to the verdict by nothing but what the page shows', (step) => {
    step('finds the case and its verdict in the list', async () => {
      const { page } = visitor;
      await page.goto(appliance.signIn);
      const row = page.locator('.case-row');
      await expect.poll(() => row.count()).toBe(1);
      await expect.poll(() => row.textContent()).toMatch(/IntactFound \d/);
      await row.getByRole('link').first().click();
    });

    step('finds a mark, the pressure at it, and the plan beside it', async () => {
      const { page } = visitor;
      await page.locator('.pane-plan video').waitFor();
      await settled(page);
      for (let mark = 0; mark < 3; ++mark) {
        await page.getByRole('button', { name: 'Next mark' }).click();
        await settled(page);
      }
      for (let times = 0; times < 2; ++times) await page.keyboard.press('Shift+ArrowRight');
      await settled(page);
      await expect.poll(() => page.locator('.pane-step').textContent()).toBe('3. Lift');
      await expect.poll(() => page.locator('.vital', { hasText: 'ABP' }).textContent()).toMatch(/\d\d+\/\d\d+/);
      await expect.poll(() => page.locator('.case-verdict').textContent()).toBe('Intact');
      // Until the newest wave is drawn.
      await page.waitForTimeout(500);
      await keepPicture(page, 'demo-mark');
      expect(await seriousBarriers(page)).toEqual([]);
    });

    step('sees step by step what was planned and what was done', async () => {
      const { page } = visitor;
      await page.getByRole('tab', { name: 'Plan' }).click();
      await page.getByText('The plan was sealed before the first picture').waitFor();
      await expect.poll(() => page.locator('table.steps caption').textContent()).toBe('6 of 6 steps found · in the planned order');
      await page.locator('table.steps').getByRole('button', { name: '4. Hold' }).click();
      await page.getByText('Over', { exact: true }).click();
      await settled(page);
      await page.waitForTimeout(500);
      await keepPicture(page, 'demo-plan');
    });

    step('sees why the verdict is what it is', async () => {
      const { page } = visitor;
      await page.locator('.case-verdict').click();
      await page.getByRole('button', { name: 'Verify now' }).click();
      await page.locator('.banner').waitFor();
      await expect.poll(() => page.locator('.banner h2').textContent()).toMatch(/^Intact/);
      await keepPicture(page, 'demo-verdict');
      expect(visitor.problems).toEqual([]);
    });
  });
});
