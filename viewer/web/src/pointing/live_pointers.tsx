// Pointing on a live picture: arrows of everybody in the room, and this person's own.
import { useSignal } from '@preact/signals';
import { useCallback, useEffect } from 'preact/hooks';
import type { LivePlayer } from '@/media/live_player';
import type { Company } from '@/pointing/company';
import { PointerLayer } from '@/pointing/pointer_layer';
import { seenAt } from '@/pointing/pointers';
import { word } from '@/i18n/i18n';

const kFrame_ms = 100;

interface Props {
  company: Company;
  stream: string;
  player: LivePlayer;
  /** The case that it would stand in: a guest's is that of their invitation, which the server knows. */
  about: string | undefined;
  /** Whether that runs. */
  mayPoint: boolean;
}

export function LivePointers({ company, stream, player, about, mayPoint }: Props) {
  const now_ms = useSignal(performance.now());
  const some = company.pointers.value.some((one) => one.stream === stream);
  useEffect(() => {
    if (!some) return;
    const timer = setInterval(() => (now_ms.value = performance.now()), kFrame_ms);
    return () => clearInterval(timer);
  }, [some]);
  const video = useCallback(() => player.video, [player]);
  const at_ms = Math.max(now_ms.value, ...company.pointers.value.map((one) => one.came_ms));
  return (
    <PointerLayer
      seen={seenAt(company.pointers.value, stream, (one) => at_ms - one.came_ms)}
      video={video}
      name={word('stream', stream)}
      about={about}
      onPoint={mayPoint ? ({ x, y }) => company.point(about, stream, x, y, player.shown?.media_ns) : undefined}
    />
  );
}
