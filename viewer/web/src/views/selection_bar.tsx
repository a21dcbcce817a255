import type { Span } from '@/base/spans';
import { formatDuration, formatTime } from '@/base/time';
import { t } from '@/i18n/i18n';
import { Icon } from '@/shell/icon';

interface Props {
  chosen: Span;
  begins_ns: number;
  onExport: (() => void) | undefined;
  onClear: () => void;
}

export function SelectionBar({ chosen, begins_ns, onExport, onClear }: Props) {
  return (
    <div class="selection-bar" role="region" aria-label={t('selection.label')}>
      <span>{t('selection.label')}</span>
      <span class="mono">
        {formatTime(chosen.start_ns - begins_ns, 3)} – {formatTime(chosen.end_ns - begins_ns, 3)}
      </span>
      <span class="muted">{formatDuration(chosen.end_ns - chosen.start_ns)}</span>
      {onExport && (
        <button type="button" class="button" onClick={onExport}>
          <Icon name="export" />
          {t('export.open')}
        </button>
      )}
      <button type="button" class="button button-quiet" onClick={onClear}>
        {t('selection.clear')}
      </button>
    </div>
  );
}
