// The chain as a drawing: five links, each with its sign, its name and how much of it there is; a broken one is torn from the next. Every link is a
// button that shows its findings.
import type { VerificationReport } from '@/api/types';
import { formatBytes } from '@/base/time';
import { t } from '@/i18n/i18n';
import type { ChainLink, LinkName, LinkState } from '@/verification/chain';

const kWidth = 168;
const kHeight = 118;
const kBetween = 40;

const kSigns: Record<LinkState, string> = {
  holds: 'M-7 0l5 5 9-10',
  partly: 'M-7 0h5M2 0h5',
  open: 'M-3.5 -3.5a3.7 3.7 0 1 1 5.3 3.6c-1.2.7-1.8 1.4-1.8 2.7M0 7v.2',
  broken: 'M-6 -6L6 6M6 -6L-6 6',
};

function amountOf(name: LinkName, report: VerificationReport): string {
  switch (name) {
    case 'segments':
      return t('chain.segments', { n: report.streams.reduce((sum, one) => sum + one.segments, 0), size: formatBytes(report.bytes) });
    case 'ledger':
      return t('chain.entries', { n: report.entries });
    case 'checkpoints':
      return t('chain.signed', { n: report.checkpoints });
    case 'tokens':
      return t('chain.tokens', { n: report.tokens });
    case 'authority':
      return t(`time.${report.time}`);
  }
}

export function ChainDrawing({
  chain,
  report,
  selected,
  onSelect,
}: {
  chain: readonly ChainLink[];
  report: VerificationReport;
  selected: LinkName | undefined;
  onSelect: (name: LinkName | undefined) => void;
}) {
  const width = chain.length * kWidth + (chain.length - 1) * kBetween;
  return (
    <div class="chain">
      <svg viewBox={`-6 -6 ${width + 12} ${kHeight + 12}`} role="group" aria-label={t('chain.title')}>
        {chain.map((link, at) => {
          const x = at * (kWidth + kBetween);
          const broken = link.state === 'broken' || chain[at + 1]?.state === 'broken';
          const middle = kHeight / 2;
          return (
            <g key={link.name} transform={`translate(${x} 0)`}>
              {at + 1 < chain.length && (
                <path
                  class={broken ? 'chain-tie chain-tie-broken' : 'chain-tie'}
                  d={
                    broken ? `M${kWidth} ${middle}h12l4 -7M${kWidth + kBetween} ${middle}h-12l-4 7` : `M${kWidth + 4} ${middle}h${kBetween - 9}m-7 -6l7 6l-7 6`
                  }
                />
              )}
              <g
                class={`chain-link chain-${link.state}${selected === link.name ? ' chain-selected' : ''}`}
                role="button"
                tabIndex={0}
                aria-pressed={selected === link.name}
                onClick={() => onSelect(selected === link.name ? undefined : link.name)}
                onKeyDown={(event) => {
                  if (event.key !== 'Enter' && event.key !== ' ') return;
                  event.preventDefault();
                  onSelect(selected === link.name ? undefined : link.name);
                }}
              >
                <rect class="chain-box" width={kWidth} height={kHeight} rx="12" />
                <g transform={`translate(${kWidth / 2} 26)`}>
                  <circle class="chain-ring" r="13" />
                  <path class="chain-sign" d={kSigns[link.state]} />
                </g>
                <text class="chain-name" x={kWidth / 2} y="60" text-anchor="middle">
                  {t(`link.${link.name}`)}{' '}
                </text>
                <text class="chain-state" x={kWidth / 2} y="80" text-anchor="middle">
                  {t(`linkState.${link.state}`)}{' '}
                </text>
                <text class="chain-amount" x={kWidth / 2} y="100" text-anchor="middle">
                  {amountOf(link.name, report)}
                </text>
              </g>
            </g>
          );
        })}
      </svg>
    </div>
  );
}
