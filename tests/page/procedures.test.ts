// Whom a case is about out of the hospital's own list: patients whom messages placed in the room, to choose from when a recording starts.
import { once } from 'node:events';
import { connect } from 'node:net';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { Appliance, freePort, seriousBarriers, startBrowser, until, visitSignedIn, type Visitor } from './kit';
import { expectFits } from './layout';

let appliance: Appliance;
let browser: Browser;
let visitor: Visitor;
/** The older of the two who were placed in the room leaves it. */
let leave: () => Promise<string>;

/** Sends a message in HL7's lower layer; what is answered. */
async function deliver(port: number, segments: string[]): Promise<string> {
  const socket = connect(port, '127.0.0.1');
  await once(socket, 'connect');
  socket.write(`\x0b${segments.join('\r')}\r\x1c\r`);
  const [answer] = (await once(socket, 'data')) as [Buffer];
  socket.destroy();
  return answer.toString();
}

beforeAll(async () => {
  const port = await freePort();
  appliance = await Appliance.start(false, `[room.procedure.hl7]\nlisten = "mllp://127.0.0.1:${port}?zone=UTC"\nlocations = ["OR1"]\n`);
  const now = new Date().toISOString().replace(/\D/g, '').slice(0, 14);
  const tell = (event: string, message: string, id: string, patient: string) =>
    deliver(port, [
      `MSH|^~\\&|ADT|HOSP|||${now}||ADT^${event}|${message}|P|2.5||||||UNICODE UTF-8`,
      `PID|1||${id}^^^HOSP^MR||${patient}||19800115|F`,
      'PV1|1|I|OR1',
    ]);
  const place = (id: string, patient: string) => tell('A02', id, id, patient);
  leave = () => tell('A03', '19', '17', 'Mori^Aya');
  await until('the room listens', () =>
    place('17', 'Mori^Aya').then(
      (answer) => answer.includes('MSA|AA'),
      () => undefined,
    ),
  );
  await place('18', 'Ito^Ken');
  browser = await startBrowser();
  visitor = await visitSignedIn(browser, appliance);
});
afterAll(async () => {
  await browser?.close();
  await appliance?.stop();
});

describe('The hospital’s list', () => {
  it('is offered when a recording starts, and who is chosen stands in the list of cases', async () => {
    const { page } = visitor;
    await page.goto(`${appliance.url}#/rooms`);
    await page.getByRole('button', { name: 'Start recording' }).click();
    const dialog = page.getByRole('dialog', { name: 'Start recording in or-1' });
    await dialog.getByRole('radio', { name: /Ito Ken \(18, born 1980-01-15, F\)/ }).waitFor();
    await dialog.getByText('You choose nobody. The recorder itself takes what the hospital’s systems say').waitFor();
    await dialog.getByRole('radio', { name: /Mori Aya/ }).check();
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(visitor, 'start-list');
    await dialog.getByRole('button', { name: 'Start with these data' }).click();
    await page.locator('.room-recording').waitFor();
    await page.getByText('Patient and procedure are recorded').waitFor();
    await page.getByRole('button', { name: 'Stop', exact: true }).click();
    await page.locator('dialog').getByRole('button', { name: 'Stop' }).click();
    await page.getByRole('button', { name: 'Start recording' }).waitFor();
    await page.goto(`${appliance.url}#/cases`);
    await page.locator('.case-row', { hasText: 'Mori Aya (17' }).waitFor();
    expect(visitor.problems).toEqual([]);
  });
});

describe('What a person prepares in one case', () => {
  /** What was there before each of them: cases begin within one second here. */
  let known: string[];
  const newest = () => {
    const id = appliance.caseSince(known);
    known.push(id);
    return id;
  };
  const next = async () => {
    await appliance.kiroku('case', 'stop');
    await appliance.kiroku('case', 'start');
    return newest();
  };
  beforeAll(async () => {
    known = appliance.cases();
    // Of two in the room the recorder takes neither.
    expect(await leave()).toContain('MSA|AA');
  });

  it('gets into no other unless they say so, and nothing of it is lost', async () => {
    const { page } = visitor;
    await appliance.kiroku('case', 'start');
    const first = newest();
    await page.goto(`${appliance.url}#/rooms`);
    const late = page.getByRole('dialog', { name: 'Whom is the case in or-1 about?' });
    const record = late.getByRole('button', { name: 'Record these data' });
    const patient = (dialog: typeof late) => dialog.getByLabel('Patient', { exact: true });
    await page.getByRole('button', { name: 'Correct patient' }).click();
    await late.getByRole('radio', { name: 'Type it in' }).check();
    await patient(late).fill('Anton Before');

    // Nobody says for a while what the room does: nothing is done meanwhile, and nothing is lost.
    await page.route('**/api/status', (route) => route.fulfill({ status: 503, json: { error: 'no recorder answers' } }));
    await late.getByText('The recorder does not answer, so nobody knows what the room does now. What you typed is kept.').waitFor();
    await page.getByText(/^Not known since \d/).waitFor();
    await expect.poll(() => record.isDisabled()).toBe(true);
    await page.unroute('**/api/status');
    await expect.poll(() => record.isDisabled()).toBe(false);
    await expect.poll(() => patient(late).inputValue()).toBe('Anton Before');

    // Somebody else ends the case, and begins the next.
    const second = await next();
    await late.getByText(`Case ${first} has ended while this was open, and case ${second} runs now.`).waitFor();
    await expect.poll(() => record.isDisabled()).toBe(true);
    await page.keyboard.press('Enter');
    expect(await seriousBarriers(page)).toEqual([]);
    await expectFits(visitor, 'start-changed');
    await expect.poll(() => patient(late).inputValue()).toBe('Anton Before');
    await late.getByRole('button', { name: `They belong to case ${second}` }).click();
    await record.click();
    await late.waitFor({ state: 'detached' });

    // The page does not know yet that the case has ended: the room does.
    const shown = (await page.evaluate(async () => (await fetch('/api/status')).json() as Promise<unknown>)) as object;
    await page.route('**/api/status', (route) => route.fulfill({ json: shown }));
    await page.getByRole('button', { name: 'Correct patient' }).click();
    await late.getByRole('radio', { name: 'Type it in' }).check();
    await patient(late).fill('Berta Late');
    await appliance.kiroku('case', 'stop');
    await record.click();
    await late.getByText(`room or-1 is not recording case ${second}: nothing was done`).waitFor();
    await page.unroute('**/api/status');
    await late.getByText(`Case ${second} has ended while this was open.`).waitFor();
    await late.getByRole('button', { name: 'They belong to a case that is to begin' }).click();
    const start = page.getByRole('dialog', { name: 'Start recording in or-1' });
    await expect.poll(() => patient(start).inputValue()).toBe('Berta Late');
    await start.getByRole('button', { name: 'Start with these data' }).click();
    await start.waitFor({ state: 'detached' });
    await page.locator('.room-recording').waitFor();
    const third = newest();
    expect(third).not.toBe(second);

    // A mark and a question that were begun in that case.
    await page.getByLabel('What happens now?').fill('clip placed');
    const fourth = await next();
    await page.getByText(`This was written before case ${fourth} began. Does it belong to it?`).waitFor();
    await page.getByRole('button', { name: 'It belongs to it' }).click();
    await page.getByRole('button', { name: 'Mark', exact: true }).click();
    await expect.poll(() => page.getByLabel('What happens now?').inputValue()).toBe('');
    await page.getByRole('button', { name: 'Stop', exact: true }).click();
    const fifth = await next();
    const stopping = page.locator('dialog');
    await stopping.getByText(`Case ${fourth} has ended while this was open. Case ${fifth} goes on.`).waitFor();
    await expect.poll(() => stopping.getByRole('button', { name: 'Stop' }).isDisabled()).toBe(true);
    await stopping.getByRole('button', { name: 'Close' }).click();
    await page.locator('.room-recording').waitFor();
    await appliance.kiroku('case', 'stop');

    await page.goto(`${appliance.url}#/cases`);
    for (const [id, name] of [
      [second, 'Anton Before'],
      [third, 'Berta Late'],
    ] as const)
      await page.locator('.case-row', { hasText: id }).getByText(name).waitFor();
    for (const id of [first, fourth, fifth]) await page.locator('.case-row', { hasText: id }).getByText('Ito Ken').waitFor();
    expect(visitor.problems.splice(0).filter((one) => !/status of (409|503)/.test(one))).toEqual([]);
  });

  it('is refused also where a dialog of a beginning finds that another case began', async () => {
    const { page } = visitor;
    await page.goto(`${appliance.url}#/rooms`);
    await page.getByRole('button', { name: 'Start recording' }).click();
    const start = page.getByRole('dialog', { name: 'Start recording in or-1' });
    await start.getByRole('radio', { name: 'Type it in' }).check();
    await start.getByLabel('Patient', { exact: true }).fill('Cora Next');
    await appliance.kiroku('case', 'start');
    const begun = newest();
    await start.getByText(`Case ${begun} began in or-1 while this was open.`).waitFor();
    await expect.poll(() => start.getByRole('button', { name: 'Start with these data' }).isDisabled()).toBe(true);
    const before = appliance.cases().length;
    await appliance.kiroku('case', 'stop');
    await start.getByText(`Case ${begun} was recorded in or-1 while this was open.`).waitFor();
    await start.getByRole('button', { name: 'Close' }).click();
    expect(appliance.cases().length).toBe(before);
    expect(visitor.problems).toEqual([]);
  });
});
