import js from '@eslint/js';
import svelte from 'eslint-plugin-svelte';
import globals from 'globals';
import typescript from 'typescript-eslint';

export default typescript.config(
  js.configs.recommended,
  ...typescript.configs.strict,
  ...svelte.configs.recommended,
  { languageOptions: { globals: { ...globals.browser, ...globals.node } } },
  {
    files: ['**/*.svelte', '**/*.svelte.ts'],
    languageOptions: { parserOptions: { parser: typescript.parser } },
  },
  {
    rules: {
      // Where an index was checked on the line before, `!` says so.
      '@typescript-eslint/no-non-null-assertion': 'off',
      // What changes with every snapshot is plain data on purpose.
      'svelte/prefer-svelte-reactivity': 'off',
    },
  },
  { ignores: ['src/wire/generated/', '../race_server/'] },
);
