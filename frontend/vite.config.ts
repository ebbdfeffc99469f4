import { defineConfig } from "vitest/config";

// The bundle is tracked in the Python package, so that a clone and a wheel need no Node.
export default defineConfig({
  base: "./",
  publicDir: "public",
  build: {
    outDir: "../src/turnscan/app/static",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: { polyfill: false },
    // An inlined file would be a data: address, which the content security policy refuses.
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 900,
    rolldownOptions: {
      output: {
        // three.js changes with its version alone: its file stays the same from build to build.
        codeSplitting: { groups: [{ name: "three", test: /node_modules[\\/]three/ }] },
      },
    },
  },
  // On a machine with much else to do, loading all modules takes many seconds.
  test: { include: ["test/**/*.test.ts"], testTimeout: 120_000 },
});
