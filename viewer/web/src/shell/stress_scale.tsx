// What the colours of stress stand for: viridis from 0 to the most, as the server paints it.
export function StressScale({ most, label }: { most: number; label: string }) {
  return (
    <figure class="stress-scale" aria-label={label}>
      <div class="stress-scale-bar" aria-hidden="true" />
      <ol aria-hidden="true">
        {[1, 0.75, 0.5, 0.25, 0].map((share) => (
          <li key={share}>{share * most}</li>
        ))}
      </ol>
      <figcaption>{label}</figcaption>
    </figure>
  );
}
