// Arrows over a video that was recorded, where people pointed when it was.
import { useCallback } from 'preact/hooks';
import { word } from '@/i18n/i18n';
import type { PanePlayer } from '@/media/pane_player';
import type { Playback } from '@/media/playback';
import { PointerLayer } from '@/pointing/pointer_layer';
import type { RecordedPointing } from '@/pointing/recorded';

export function RecordedPointers({ pointing, player, playback }: { pointing: RecordedPointing; player: PanePlayer; playback: Playback }) {
  const video = useCallback(() => player.video, [player]);
  void pointing.version.value; // drawn anew when points come
  return <PointerLayer seen={pointing.seen(player.stream, playback.position_ns.value)} video={video} name={word('stream', player.stream)} />;
}
