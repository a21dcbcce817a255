// What a finding says: in English the verifier's own sentence; in another language what its code means, with that sentence below.
import type { Finding } from '@/api/types';
import { language } from '@/i18n/i18n';

export function FindingText({ finding }: { finding: Finding }) {
  if (language.value === 'en') return <span>{finding.text}</span>;
  return (
    <span class="finding-text">
      <span>{finding.meaning[language.value]}</span>
      <small class="muted" lang="en">
        {finding.text}
      </small>
    </span>
  );
}
