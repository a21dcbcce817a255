// What TypeScript itself does not find in the page and its tests: promises that nobody waits for, values of any type, texts of objects, markup from strings.
import hooks from 'eslint-plugin-react-hooks';
import tseslint from 'typescript-eslint';

const kMarkup = 'Show text: markup made from strings lets a recorded name or an answer of the server run as a program.';
const kOnce = 'A page that is still changing is asked again: await expect.poll(() => …). What is read once races with it.';

export default tseslint.config(
  { ignores: ['node_modules', 'dist'] },
  tseslint.configs.recommendedTypeChecked,
  { linterOptions: { reportUnusedDisableDirectives: 'error' }, languageOptions: { parserOptions: { projectService: true } } },
  {
    // By their names, which Preact's hooks share with React's.
    plugins: { 'react-hooks': hooks },
    rules: {
      'react-hooks/rules-of-hooks': 'error',
      '@typescript-eslint/switch-exhaustiveness-check': ['error', { considerDefaultExhaustiveForUnions: true }],
      eqeqeq: 'error',
      'no-restricted-syntax': [
        'error',
        { selector: 'AssignmentExpression > MemberExpression.left[property.name=/^(inner|outer)HTML$/]', message: kMarkup },
        { selector: 'CallExpression > MemberExpression.callee[property.name="insertAdjacentHTML"]', message: kMarkup },
        { selector: 'JSXAttribute[name.name="dangerouslySetInnerHTML"]', message: kMarkup },
        {
          selector:
            'CallExpression[callee.name="expect"] > AwaitExpression > ' +
            'CallExpression[callee.property.name=/^(count|getAttribute|inputValue|is(Checked|Disabled|Editable|Enabled|Hidden|Visible))$/]',
          message: kOnce,
        },
      ],
    },
  },
);
