import { useSignal } from '@preact/signals';
import { useLayoutEffect, useRef } from 'preact/hooks';

/** Below this nothing can be drawn. */
const kLeast = 50;

/** An element's width in pixels, as it changes. */
export function useWidth() {
  const element = useRef<HTMLDivElement>(null);
  const width = useSignal(kLeast);
  useLayoutEffect(() => {
    const one = element.current as HTMLDivElement;
    const measure = () => {
      width.value = Math.max(kLeast, one.clientWidth);
    };
    const observer = new ResizeObserver(measure);
    observer.observe(one);
    measure();
    return () => observer.disconnect();
  }, []);
  return { element, width };
}
