// The plan's pictures: in a pane of their own, or over those of the recording.
import { useEffect, useRef } from 'preact/hooks';
import { stepAt } from '@/compare/plan_map';
import type { PlanModel, ShownComparison } from '@/compare/plan_model';
import { t } from '@/i18n/i18n';
import type { Playback } from '@/media/playback';

function usePlaced(shown: ShownComparison) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const video = shown.player?.video;
    if (!video) return;
    place.current?.prepend(video);
    video.setAttribute('aria-label', t('plan.pictures'));
    return () => {
      // Another place may have it already.
      if (video.parentElement === place.current) video.remove();
    };
  }, [shown]);
  return place;
}

export function PlanPane({ shown, playback }: { shown: ShownComparison; playback: Playback }) {
  const place = usePlaced(shown);
  const step = stepAt(shown.document.steps, playback.position_ns.value);
  return (
    <section class="pane pane-plan" aria-label={t('plan.pictures')}>
      <div class="pane-picture" ref={place} />
      <header class="pane-head">
        <h2>{t('plan.pictures')}</h2>
        <span class="pane-step">{step ? `${step.step}. ${step.name}` : t('plan.noStep')}</span>
      </header>
    </section>
  );
}

/** Clear below a ninth of white, opaque from a fifth on: the background of the plan's pictures (viewer/compare/composition.h) lies far below. */
function DarkIsClear() {
  return (
    <svg width="0" height="0" aria-hidden="true" focusable="false">
      <filter id="plan-key" color-interpolation-filters="sRGB">
        <feColorMatrix type="matrix" values="1 0 0 0 0  0 1 0 0 0  0 0 1 0 0  5 5 5 0 -1.7" />
      </filter>
    </svg>
  );
}

export function PlanOver({ plan, shown }: { plan: PlanModel; shown: ShownComparison }) {
  const place = usePlaced(shown);
  const share = plan.share.value;
  const wipes = plan.view.value === 'wipe';
  const differs = plan.view.value === 'difference';
  const style = wipes ? { clipPath: `inset(0 ${(1 - share) * 100}% 0 0)` } : differs ? {} : { opacity: share };
  // The plan's pictures are dark where there is no tissue: there the recording stays as it is. Radiographs have no such place.
  const keyed = !wipes && shown.film === 'replay';
  const blend = differs ? ' plan-over-difference' : keyed ? ' plan-over-keyed' : '';
  return (
    <div class="plan-over">
      {keyed && <DarkIsClear />}
      <div class={`plan-over-picture${blend}`} ref={place} style={style} />
      {wipes && <div class="plan-edge" style={{ left: `${share * 100}%` }} />}
    </div>
  );
}
