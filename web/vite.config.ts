import { svelte } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vitest/config';

// A gateway that runs on this machine, for `npm run dev`.
const gateway = process.env.RACE_GATEWAY ?? 'http://127.0.0.1:8080';

export default defineConfig({
  plugins: [svelte()],
  base: './',
  build: {
    outDir: '../race_server/live/gateway/page',
    emptyOutDir: true,
    target: 'es2022',
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0,
  },
  server: {
    proxy: {
      // The gateway lets in who comes from its own address.
      '/ws': { target: gateway, ws: true, changeOrigin: true, headers: { origin: gateway } },
      '/recordings': gateway,
    },
  },
  test: { include: ['test/**/*.test.ts'], environment: 'node' },
});
