// The frame around every view: who is signed in, where one can go, what is said aloud.
import { useEffect } from 'preact/hooks';
import { ApiError, kNoAnswer, session as api, whenSignedOut } from '@/api/client';
import { hrefOf, route, type Route, signInLink } from '@/base/route';
import { AppliancesView } from '@/fleet/appliances_view';
import { FleetCasesView } from '@/fleet/fleet_cases_view';
import { FleetRoomsView } from '@/fleet/fleet_rooms_view';
import { invitationLink } from '@/guests/guest_api';
import { guestIsOver, invited } from '@/guests/guest_state';
import { GuestView } from '@/guests/guest_view';
import { JoinView, OverView } from '@/guests/join_view';
import { hasChosenLanguage, language, setLanguage, t } from '@/i18n/i18n';
import { returns } from '@/shell/connection';
import { GoneBanner } from '@/shell/gone_banner';
import { Icon, type IconName } from '@/shell/icon';
import { LogView } from '@/log/log_view';
import { OwnPassword } from '@/shell/own_password';
import { may } from '@/shell/rights';
import { announcement, attempt, dismiss, notices, notifyOf, oneTimePassword, session, sessionEnded, setTheme, theme } from '@/shell/state';
import { lookForWorkplaces, workplaces } from '@/shell/workplaces';
import { WorkplaceView } from '@/shell/workplace_view';
import { BreathingView } from '@/breathing/breathing_view';
import { PlanningView } from '@/planning/planning_view';
import { TrainingView } from '@/training/training_view';
import { CaseView } from '@/views/case_view';
import { CasesView } from '@/views/cases_view';
import { PasswordView } from '@/views/password_view';
import { RoomsView } from '@/views/rooms_view';
import { SignInView } from '@/views/sign_in_view';
import { UsersView } from '@/views/users_view';
import { VerificationView } from '@/views/verification_view';

whenSignedOut(() => {
  if (session.value?.role === 'guest') guestIsOver.value = true;
  else if (session.value) sessionEnded.value = true;
  oneTimePassword.value = undefined;
  session.value = null;
});

async function findSession(): Promise<void> {
  const link = signInLink(location.hash);
  invited.value ??= invitationLink(location.hash);
  // Neither must stay in the history.
  if (link !== undefined || invitationLink(location.hash) !== undefined) history.replaceState(null, '', '/');
  try {
    if (link !== undefined) await api.signInByLink(link);
  } catch (error) {
    notifyOf(error);
  }
  try {
    session.value = await api.get();
  } catch (error) {
    // A server that is away has ended no session: it is asked again once it is back.
    if (error instanceof ApiError && error.status === kNoAnswer) return;
    session.value = null;
  }
}

function Switches() {
  const dark = theme.value === 'dark';
  return (
    <>
      <button
        type="button"
        class="button button-quiet"
        lang={language.value === 'en' ? 'ja' : 'en'}
        onClick={() => setLanguage(language.value === 'en' ? 'ja' : 'en')}
      >
        {t('language.other')}
      </button>
      <button
        type="button"
        class="button button-quiet button-square"
        aria-label={dark ? t('theme.toLight') : t('theme.toDark')}
        title={dark ? t('theme.toLight') : t('theme.toDark')}
        onClick={() => setTheme(dark ? 'light' : 'dark')}
      >
        <Icon name={dark ? 'sun' : 'moon'} />
      </button>
    </>
  );
}

function NavLink({
  to,
  icon,
  text,
}: {
  to: 'cases' | 'appliances' | 'rooms' | 'log' | 'users' | 'training' | 'planning' | 'breathing';
  icon: IconName;
  text: string;
}) {
  const view = route.value.view;
  // A server of planning, a lung or training alone shows it at every address.
  const isAlone = session.value?.serves === to && to !== 'cases';
  const here = view === to || (isAlone && view !== 'users') || (to === 'cases' && (view === 'case' || view === 'verification'));
  const state = to === 'planning' || to === 'breathing' || to === 'training' ? workplaces.value[to] : undefined;
  const isAway = state !== undefined && state !== 'open';
  return (
    <a
      href={hrefOf({ view: to })}
      class={isAway ? 'nav-link nav-link-away' : 'nav-link'}
      aria-current={here ? 'page' : undefined}
      title={isAway ? t('place.away') : undefined}
    >
      <Icon name={icon} />
      {text}
      {isAway && <span class="only-heard"> ({t('place.away')})</span>}
    </a>
  );
}

function Header() {
  const signedIn = session.value;
  const serves = signedIn?.serves ?? 'cases';
  const guest = signedIn?.role === 'guest';
  return (
    <header class="top">
      <a class="brand" href={hrefOf({ view: serves === 'fleet' ? 'cases' : serves })}>
        <svg class="brand-sign" viewBox="0 0 32 32" aria-hidden="true">
          <circle cx="16" cy="16" r="12" />
          <circle cx="16" cy="16" r="5" class="brand-dot" />
        </svg>
        <span>Kiroku</span>
        <span class="brand-kanji" lang="ja" aria-hidden="true">
          記録
        </span>
      </a>
      {signedIn && !guest && !signedIn.must_change_password && (
        <nav aria-label={t('nav.label')} class="nav">
          {serves === 'training' && <NavLink to="training" icon="training" text={t('nav.training')} />}
          {serves === 'planning' && may(signedIn.role, 'plan') && <NavLink to="planning" icon="plan" text={t('nav.planning')} />}
          {serves === 'breathing' && may(signedIn.role, 'plan') && <NavLink to="breathing" icon="lung" text={t('nav.breathing')} />}
          {serves === 'cases' && (
            <>
              <NavLink to="cases" icon="cases" text={t('nav.cases')} />
              <NavLink to="planning" icon="plan" text={t('nav.planning')} />
              {/* Few have it: there is a way there while it runs. */}
              {(workplaces.value.breathing === 'open' || route.value.view === 'breathing') && <NavLink to="breathing" icon="lung" text={t('nav.breathing')} />}
              <NavLink to="training" icon="training" text={t('nav.training')} />
            </>
          )}
          {serves === 'fleet' && (
            <>
              {may(signedIn.role, 'see-live') && <NavLink to="rooms" icon="record" text={t('nav.rooms')} />}
              <NavLink to="cases" icon="cases" text={t('nav.cases')} />
              <NavLink to="appliances" icon="rooms" text={t('nav.appliances')} />
            </>
          )}
          {serves === 'cases' && may(signedIn.role, 'see-live') && <NavLink to="rooms" icon="rooms" text={t('nav.rooms')} />}
          {(serves === 'cases' || serves === 'fleet') && may(signedIn.role, 'read-log') && <NavLink to="log" icon="document" text={t('nav.log')} />}
          {may(signedIn.role, 'manage-users') && <NavLink to="users" icon="users" text={t('nav.users')} />}
        </nav>
      )}
      <div class="top-end">
        {signedIn?.unlocked && (
          <button
            type="button"
            class="button button-quiet"
            onClick={() =>
              void attempt(async () => {
                await api.lock();
                await findSession();
              })
            }
          >
            <Icon name="unlocked" />
            <span class="top-text">{t('lock.now')}</span>
          </button>
        )}
        <Switches />
        {signedIn && !guest && signedIn.has_password && !signedIn.must_change_password && <OwnPassword />}
        {signedIn && !guest && (
          <button
            type="button"
            class="button button-quiet"
            title={t('signOut')}
            onClick={() =>
              void attempt(async () => {
                await api.signOut();
                sessionEnded.value = false;
                oneTimePassword.value = undefined;
                session.value = null;
              })
            }
          >
            <span class="user-name">
              {signedIn.user}
              <small>{t(`role.${signedIn.role}`)}</small>
            </span>
            <Icon name="signOut" />
            <span class="only-heard">{t('signOut')}</span>
          </button>
        )}
      </div>
    </header>
  );
}

function MayNot({ what }: { what: string }) {
  return (
    <main id="main" class="main narrow" tabIndex={-1}>
      <p>{what}</p>
    </main>
  );
}

/** Where the person is at the hospital's page, which has no workplaces of its own. */
function FleetPlace({ here }: { here: Route }) {
  switch (here.view) {
    case 'case':
      return <CaseView key={here.id} id={here.id} />;
    case 'verification':
      return <VerificationView key={here.id} id={here.id} />;
    case 'rooms':
      return may(session.value?.role, 'see-live') ? <FleetRoomsView /> : <FleetCasesView />;
    case 'appliances':
      return <AppliancesView />;
    case 'log':
      return <LogView />;
    case 'users':
      return <UsersView />;
    case 'cases':
      return <FleetCasesView key={here.appliance ?? ''} first={here.appliance} />;
    default:
      return <FleetCasesView />;
  }
}

function View() {
  if (session.value === undefined) return <main id="main" class="main" aria-busy="true" />;
  if (invited.value !== undefined) return <JoinView token={invited.value} />;
  if (session.value === null) return guestIsOver.value ? <OverView /> : <SignInView />;
  if (session.value.role === 'guest') return <GuestView guest={session.value} />;
  if (session.value.must_change_password) return <PasswordView />;
  const here = route.value;
  if (session.value.serves === 'training') return here.view === 'users' ? <UsersView /> : <TrainingView />;
  if (session.value.serves === 'planning') {
    if (here.view === 'users') return <UsersView />;
    return may(session.value.role, 'plan') ? <PlanningView /> : <MayNot what={t('planning.mayNot')} />;
  }
  if (session.value.serves === 'breathing') {
    if (here.view === 'users') return <UsersView />;
    return may(session.value.role, 'plan') ? <BreathingView /> : <MayNot what={t('breathing.mayNot')} />;
  }
  if (session.value.serves === 'fleet') return <FleetPlace here={here} />;
  switch (here.view) {
    case 'appliances':
    case 'cases':
      return <CasesView />;
    case 'case':
      return <CaseView key={here.id} id={here.id} />;
    case 'verification':
      return <VerificationView key={here.id} id={here.id} />;
    case 'rooms':
      return <RoomsView />;
    case 'log':
      return <LogView />;
    case 'users':
      return <UsersView />;
    case 'planning':
      return (
        <WorkplaceView place="planning">
          <PlanningView />
        </WorkplaceView>
      );
    case 'breathing':
      return (
        <WorkplaceView place="breathing">
          <BreathingView />
        </WorkplaceView>
      );
    case 'training':
      return (
        <WorkplaceView place="training">
          <TrainingView />
        </WorkplaceView>
      );
  }
}

export function App() {
  const returned = returns.value;
  useEffect(() => {
    if (returned > 0 && session.peek() === undefined) void findSession();
  }, [returned]);
  useEffect(() => {
    void findSession();
    // An invitation that is opened where the page is open already.
    const linked = () => {
      if (invitationLink(location.hash) !== undefined) void findSession();
    };
    addEventListener('hashchange', linked);
    return () => removeEventListener('hashchange', linked);
  }, []);
  // Lists scroll with the document, which stays while views change.
  const here = route.value;
  useEffect(() => scrollTo(0, 0), [here.view, 'id' in here ? here.id : '']);
  const who = session.value?.user;
  const isOneTime = session.value?.must_change_password;
  useEffect(() => {
    workplaces.value = {};
    if (who !== undefined) void lookForWorkplaces();
  }, [who, isOneTime]);
  const chosen = session.value?.language;
  useEffect(() => {
    if ((chosen === 'en' || chosen === 'ja') && !hasChosenLanguage()) setLanguage(chosen, false);
  }, [chosen]);
  return (
    <div class="page">
      <a
        class="skip"
        href="#main"
        onClick={(event) => {
          event.preventDefault();
          document.getElementById('main')?.focus();
        }}
      >
        {t('skip')}
      </a>
      <div class="top-stack">
        <Header />
        <GoneBanner />
      </div>
      <View />
      <div class="notices" role="alert">
        {notices.value.map((notice) => (
          <div key={notice.id} class={`notice notice-${notice.kind}`}>
            <Icon name={notice.kind === 'problem' ? 'alarm' : 'check'} />
            <span>{notice.text}</span>
            <button type="button" class="button button-quiet button-square" aria-label={t('close')} onClick={() => dismiss(notice.id)}>
              <Icon name="cross" />
            </button>
          </div>
        ))}
      </div>
      <div class="only-heard" role="status" aria-live="polite">
        {announcement.value}
      </div>
    </div>
  );
}
