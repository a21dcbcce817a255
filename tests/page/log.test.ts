// The appliance log in a browser, before a real server.
import { appendFileSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, beforeEach, describe, expect, it } from 'vitest';
import { Appliance, keepPicture, seriousBarriers, startBrowser, visitSignedIn, type Visitor } from './kit';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;

beforeAll(async () => {
  appliance = await Appliance.start();
  await appliance.kiroku('case', 'start');
  await appliance.kiroku('case', 'stop');
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});

beforeEach(async () => {
  const { page } = visitor;
  await page.goto(`${appliance.url}#/cases`);
  await page.getByRole('link', { name: 'Log' }).click();
  await rows().first().waitFor();
});

afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

const kind = () => visitor.page.locator('.log-kind select');
const rows = () => visitor.page.locator('.log-table tbody tr');

describe('The appliance log', () => {
  it('shows what happened, newest first, and is whole', async () => {
    const { page } = visitor;
    const numbers = (await rows().locator('th').allTextContents()).map(Number);
    expect(numbers).toEqual([...numbers].sort((one, other) => other - one));
    expect(numbers.at(-1)).toBe(0);
    await page.locator('.log-verdict').getByText('What is here is whole').waitFor();
    await rows().getByText('Case begun').waitFor();
    await rows().getByText('unlocked recordings').waitFor();
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'log');
  });

  it('shows one kind alone', async () => {
    await kind().selectOption('Case closed');
    await expect.poll(() => rows().count()).toBe(1);
    await expect.poll(() => rows().locator('a').textContent()).toBe(appliance.cases()[0]);
    await kind().selectOption('Recording erased');
    await visitor.page.getByText('There is no such entry.').waitFor();
    await kind().selectOption('Everything');
    await expect.poll(() => rows().count()).toBeGreaterThan(3);
  });

  it('is said in Japanese, too', async () => {
    await visitor.page.getByRole('button', { name: '日本語' }).click();
    await visitor.page.getByRole('heading', { name: '装置ログ' }).waitFor();
    await visitor.page.getByRole('button', { name: 'English' }).click();
  });

  it('says what a case may be used for, and binds what is exported to it', async () => {
    const { page } = visitor;
    const id = appliance.cases()[0] as string;
    const who = join(appliance.home, 'who.txt');
    writeFileSync(who, 'Hana Mori, patient\n');
    appendFileSync(join(appliance.home, 'kiroku.toml'), '\n[consent]\ndemand_purpose = true\n');
    const openExport = async () => {
      await page.goto(`${appliance.url}#/cases/${id}`);
      await page.reload();
      await page.getByRole('button', { name: 'Export', exact: true }).click();
      await page.getByLabel('Purpose').waitFor();
    };
    const excerpt = (role: 'link' | 'button') => page.getByRole(role, { name: 'Save the excerpt' });

    await openExport();
    await page.getByText('No consent entered').waitFor();
    await page.getByText('This site demands a purpose of every export: choose one.').waitFor();
    await expect.poll(() => excerpt('button').isDisabled()).toBe(true);
    await page.getByLabel('Purpose').selectOption('teaching');
    await page.getByText('No consent to teaching was given for this case.').waitFor();
    await expect.poll(() => excerpt('link').count()).toBe(0);

    await appliance.kiroku('consent', 'give', id, '--purpose', 'teaching', '--person', who);
    await openExport();
    await page.getByText('Consent: teaching').waitFor();
    await page.getByLabel('Purpose').selectOption('teaching');
    expect(await seriousBarriers(page)).toEqual([]);
    await keepPicture(page, 'export-for-a-purpose');
    const [download] = await Promise.all([page.waitForEvent('download'), excerpt('link').click()]);
    expect(readFileSync(await download.path()).toString('latin1')).toContain('excerpt.json');
    const log = readFileSync(join(appliance.home, 'archive', 'log', 'ledger.jsonl'), 'utf8');
    expect(log.trimEnd().split('\n').at(-1)).toMatch(/"what":"took an excerpt, sealed as it is".*"purpose":"teaching"/);

    await appliance.kiroku('consent', 'withdraw', id, '--purpose', 'teaching', '--person', who);
    await openExport();
    await page.getByText('Withdrawn: teaching').waitFor();
    await page.getByLabel('Purpose').selectOption('teaching');
    await page.getByText('The consent to teaching was withdrawn').waitFor();
    await expect.poll(() => excerpt('link').count()).toBe(0);
    await page.keyboard.press('Escape');
  });

  it('says in words that an entry was changed', async () => {
    const file = join(appliance.home, 'archive', 'log', 'ledger.jsonl');
    const whole = readFileSync(file, 'utf8');
    const { page } = visitor;
    const write = async (text: string, says: string) => {
      writeFileSync(file, '');
      appendFileSync(file, text);
      await page.getByRole('button', { name: 'Verify again' }).click();
      await page.locator('.log-verdict').getByText(says).waitFor();
    };
    await write(whole.replace('unlocked recordings', 'Unlocked recordings'), 'Something does not hold.');
    await page.locator('.log-findings li').first().waitFor();
    await write(whole, 'What is here is whole');
    expect(visitor.problems).toEqual([]);
  });
});
