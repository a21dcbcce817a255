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
  const place = (id: string, patient: string) =>
    deliver(port, [`MSH|^~\\&|ADT|HOSP|||${now}||ADT^A02|${id}|P|2.5||||||UNICODE UTF-8`, `PID|1||${id}^^^HOSP^MR||${patient}||19800115|F`, 'PV1|1|I|OR1']);
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
