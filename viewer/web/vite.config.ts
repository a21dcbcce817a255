import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vitest/config';

const source = fileURLToPath(new URL('./src', import.meta.url));
const tests = fileURLToPath(new URL('./tests', import.meta.url));

export default defineConfig({
  resolve: { alias: { '@': source } },
  esbuild: { jsx: 'automatic', jsxImportSource: 'preact' },
  build: {
    target: 'es2022',
    // The content security policy forbids data: addresses.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
  },
  test: {
    projects: [
      { extends: true, test: { name: 'unit', dir: `${tests}/unit`, environment: 'node' } },
      {
        extends: true,
        test: {
          name: 'page',
          dir: `${tests}/page`,
          environment: 'node',
          // None waits so long for what does not come: kPatience_ms of kit.ts, and as long here.
          testTimeout: 600_000,
          hookTimeout: 600_000,
          expect: { poll: { timeout: 60_000 } },
        },
      },
      // What is measured by hand (tests/bench/page.sh), and no test.
      { extends: true, test: { name: 'long', dir: `${tests}/page`, include: ['**/*.measure.ts'], environment: 'node', testTimeout: 3_600_000 } },
    ],
  },
});
