// What an export is for: one of the site's purposes, and why nothing may be exported for it.
import type { CaseConsents } from '@/api/types';
import { lastPurpose, type Obstacle, obstacleTo } from '@/consent/consent_model';
import { formatMoment, t, word } from '@/i18n/i18n';

export function obstacleInWords(obstacle: Obstacle): string {
  switch (obstacle.why) {
    case 'demanded':
      return t('export.purposeDemanded');
    case 'not-given':
      return t('export.purposeNotGiven', { purpose: word('purpose', obstacle.purpose) });
    case 'withdrawn':
      return t(obstacle.signed ? 'export.purposeWithdrawn' : 'export.purposeUnsigned', {
        purpose: word('purpose', obstacle.purpose),
        moment: formatMoment(obstacle.since),
      });
    case 'not-checked':
      return t('export.purposeNotChecked', { problem: obstacle.problem });
  }
}

export function PurposeChoice({ consents, purpose }: { consents: CaseConsents; purpose: string }) {
  const obstacle = obstacleTo(consents, purpose);
  return (
    <section class="choice">
      <label class="field">
        <span>{t('export.purpose')}</span>
        <select value={purpose} onChange={(event) => (lastPurpose.value = event.currentTarget.value)}>
          <option value="">{t(consents.demand_purpose ? 'export.purposeChoose' : 'export.purposeNone')}</option>
          {consents.site_purposes.map((one) => (
            <option key={one} value={one}>
              {word('purpose', one)}
            </option>
          ))}
        </select>
      </label>
      <p role="status" class="consents-why">
        {obstacle && obstacleInWords(obstacle)}
      </p>
    </section>
  );
}
