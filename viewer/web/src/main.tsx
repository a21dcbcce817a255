import { render } from 'preact';
import { startRouting } from '@/base/route';
import { startLanguage } from '@/i18n/i18n';
import { App } from '@/shell/app';
import { startTheme } from '@/shell/state';
import 'uplot/dist/uPlot.min.css';
import '@/styles/matching.css';
import '@/styles/picking.css';
import '@/styles/page.css';
import '@/styles/guests.css';
import '@/styles/log.css';
import '@/styles/pointing.css';
import '@/styles/training.css';
import '@/styles/planning.css';

startTheme();
startLanguage();
startRouting();
render(<App />, document.getElementById('page') as HTMLElement);
