/* SPDX-License-Identifier: GPL-2.0-or-later */
/* HAL commands: results, tables and messages. The tables were compared with halcmd of LinuxCNC 2.9. */
#include "unit.h"

#include "hal_rig.h"

#include <time.h>
#include <unistd.h>

#include "state.h"

static void expect(const char *const commands, const char *const printed)
{
    const char *const error = hal_rig_run(commands);
    if (error[0])
        fail_msg("%s: %s", commands, error);
    assert_string_equal(hal_rig_output(), printed);
}

static void refuse(const char *const commands, const char *const reason)
{
    const char *const error = hal_rig_run(commands);
    if (!strstr(error, reason))
        fail_msg("%s: got '%s', expected '%s'", commands, error, reason);
}

static void errors_name_file_line_and_reason(void **state)
{
    (void)state;
    static const struct {
        const char *commands, *error;
    } rows[] = {
        {"\n\nbogus 1", "t.hal:3: unknown command 'bogus'\n"},
        {"setp a\\\n\n", "t.hal:1: setp takes 2 arguments, 1 given: setp NAME VALUE\n"},
        {"setp a 1 2", "t.hal:1: setp takes 2 arguments, 3 given: setp NAME VALUE\n"},
        {"# c\nnet", "t.hal:2: net takes at least 1 argument, 0 given: net SIGNAL PIN...\n"},
        {"addf a b 1 2", "t.hal:1: addf takes at most 3 arguments, 4 given: addf FUNCTION THREAD [POSITION]\n"},
        {"setp nothing 1", "t.hal:1: there is no parameter or pin 'nothing'\n"},
        {"nothing = 1", "t.hal:1: there is no parameter or pin 'nothing'\n"},
        {"getp nothing", "t.hal:1: there is no parameter or pin 'nothing'\n"},
        {"ptype nothing", "t.hal:1: there is no parameter or pin 'nothing'\n"},
        {"gets nothing", "t.hal:1: there is no signal 'nothing'\n"},
        {"sets nothing 1", "t.hal:1: there is no signal 'nothing'\n"},
        {"stype nothing", "t.hal:1: there is no signal 'nothing'\n"},
        {"print \"x", "t.hal:1: a quoted text is not closed\n"},
        {"print $HOME", "t.hal:1: environment variable 'HOME' is not set\n"},
        {"newsig s xyz", "t.hal:1: unknown signal type 'xyz' (bit, float, s32 or u32)\n"},
        {"newsig s bit\nnewsig s bit", "t.hal:2: there is already a signal 's'\n"},
        {"delsig nothing", "t.hal:1: there is no signal 'nothing'\n"},
        {"show bogus", "t.hal:1: cannot show 'bogus' (all, comp, pin, sig, param, funct, thread or alias)\n"},
        {"list bogus", "t.hal:1: cannot list 'bogus' (comp, pin, sig, param, funct or thread)\n"},
        {"show pin -t what", "t.hal:1: unknown type 'what' (bit, float, s32 or u32)\n"},
        {"show pin -t", "t.hal:1: -t needs a type (bit, float, s32 or u32)\n"},
        {"save bogus", "t.hal:1: cannot save 'bogus' (help save lists what can be saved)\n"},
        {"alias bogus a b", "t.hal:1: 'bogus' is neither pin nor param\n"},
        {"unloadrt nothing", "t.hal:1: component 'nothing' is not loaded\n"},
        {"loadusr -W halui", "t.hal:1: loadusr -W: this host runs realtime components only; programs with HAL pins "
                             "need LinuxCNC\n"},
        {"run 1", "t.hal:1: threads are not running: start them first\n"},
        {"run x", "t.hal:1: 'x' is not a number of seconds from 0 to 1e9\n"},
        {"run nan", "t.hal:1: 'nan' is not a number of seconds from 0 to 1e9\n"},
        {"run -1", "t.hal:1: '-1' is not a number of seconds from 0 to 1e9\n"},
        {"histogram nothing", "t.hal:1: there is no thread 'nothing'\n"},
        {"timing bogus", "t.hal:1: timing takes nothing or 'reset', not 'bogus'\n"},
        {"status bogus", "t.hal:1: no status of 'bogus' (lock, mem or all)\n"},
        {"lock bogus", "t.hal:1: 'bogus' is not one of all, tune and none\n"},
        {"debug 6", "t.hal:1: '6' is not a message level from 0 to 5\n"},
        {"help bogus", "t.hal:1: unknown command 'bogus'\n"},
        {"source x.hal", "t.hal:1: files are not available here\n"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_string_equal(hal_rig_run(rows[i].commands), rows[i].error);
}

static void the_first_error_ends_the_file(void **state)
{
    (void)state;
    assert_string_not_equal(hal_rig_run("newsig a bit\nbogus\nnewsig b bit\n"), "");
    expect("list sig\n", "a \n");
}

static void quit_ends_the_file_without_an_error(void **state)
{
    (void)state;
    expect("newsig a bit\nquit\nbogus\n", "");
    assert_true(hal_session_ended(hal_rig_session()));
}

static void values_are_parsed_by_their_type(void **state)
{
    (void)state;
    static const struct {
        const char *signal, *value, *plain; /* plain NULL = refused */
    } rows[] = {
        {"b", "1", "TRUE"},
        {"b", "0", "FALSE"},
        {"b", "true", "TRUE"},
        {"b", "FALSE", "FALSE"},
        {"b", "yes", NULL},
        {"b", "2", NULL},
        {"b", "\"1\"", "TRUE"},
        {"s", "-2147483648", "-2147483648"},
        {"s", "2147483647", "2147483647"},
        {"s", "2147483648", NULL},
        {"s", "-2147483649", NULL},
        {"s", "010", "8"},
        {"s", "0x10", "16"},
        {"s", "1.5", NULL},
        {"s", "", NULL},
        {"u", "4294967295", "4294967295"},
        {"u", "0xFFFFFFFF", "4294967295"},
        {"u", "-1", "4294967295"},
        {"u", "4294967296", NULL},
        {"u", "99999999999999999999", NULL},
        {"f", "-1.5e-100", "-1.5e-100"},
        {"f", "0x10", "16"},
        {"f", "1.5abc", NULL},
        {"f", "123456789", "1.234568e+08"},
        {"f", "abc", NULL},
        {"f", "inf", "inf"},
    };
    expect("newsig b bit\nnewsig s s32\nnewsig u u32\nnewsig f float\n", "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char command[96], printed[64];
        snprintf(command, sizeof command, "sets %s %s\ngets %s\n", rows[i].signal,
                 rows[i].value[0] ? rows[i].value : "\"\"", rows[i].signal);
        const char *const error = hal_rig_run(command);
        if (!rows[i].plain) {
            if (!strstr(error, "value '"))
                fail_msg("%s: got '%s'", command, error);
            continue;
        }
        if (error[0])
            fail_msg("%s: %s", command, error);
        snprintf(printed, sizeof printed, "%s\n", rows[i].plain);
        assert_string_equal(hal_rig_output(), printed);
    }
}

static void setp_respects_directions_and_links(void **state)
{
    (void)state;
    expect("loadrt probe\nsetp probe.0.in 3\ngetp probe.0.in\nprobe.0.gain = 4\ngetp probe.0.gain\n", "3\n4\n");
    refuse("setp probe.0.out 1", "is an output");
    refuse("setp probe.0.seen 1", "not writable");
    refuse("net s probe.0.in\nsetp probe.0.in 1", "linked to signal 's'");
    expect("sets s 8\ngetp probe.0.in\n", "8\n");
    refuse("net s probe.0.out\nsets s 1", "driven by an output");
    expect("ptype probe.0.io\nptype probe.0.gain\nstype s\n", "bit\nfloat\nfloat\n");
}

static void net_links_all_or_nothing(void **state)
{
    (void)state;
    static const struct {
        const char *commands, *reason;
    } rows[] = {
        {"net a probe.0.out => probe.1.in nothing", "there is no pin 'nothing'"},
        {"net a probe.0.out probe.1.out", "cannot have output pin 'probe.1.out': it has pin 'probe.0.out'"},
        {"net a probe.0.in probe.1.word", "is of type u32"},
        {"net a probe.0.in taken.pin", "there is no pin"},
        {"net a probe.0.in probe.2.in", "linked to signal 'other'"},
        {"net a", "at least one pin"},
        {"net a => <=", "at least one pin"},
        {"net averyveryveryveryveryveryveryveryverylongname_48 probe.0.in", "longer than 47"},
    };
    expect("loadrt probe sets=3\nnet other probe.2.in\n", "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        refuse(rows[i].commands, rows[i].reason);
        expect("list sig\n", "other \n");
    }
    expect("net a probe.0.out => probe.1.in <= probe.0.in\nnet a probe.0.out\nshow sig a\n",
           "Signals:\n"
           "Type          Value  Name     (linked to)\n"
           "float             0  a\n"
           "                         ==> probe.0.in\n"
           "                         <== probe.0.out\n"
           "                         ==> probe.1.in\n"
           "\n");
    refuse("net a probe.1.out", "output pin 'probe.1.out' cannot be linked");
}

static void old_link_commands_work(void **state)
{
    (void)state;
    expect("loadrt probe sets=2\nnewsig s float\nlinkps probe.0.in => s\nlinksp s probe.1.in\nlinkpp probe.0.io <=> "
           "probe.1.io\nunlinkp probe.0.in\nsave link\n",
           "# links\nlinkps probe.0.io  probe.0.io\nlinkps probe.1.in  s\nlinkps probe.1.io  probe.0.io\n");
    refuse("linkps s", "takes at least 2");
    refuse("linkps probe.0.in nothing", "there is no signal 'nothing'");
    refuse("linksp nothing probe.0.in", "there is no signal 'nothing'");
    refuse("linkps => <=", "takes two names");
}

static void aliases_replace_names_in_tables(void **state)
{
    (void)state;
    expect("loadrt probe\nalias pin probe.0.in speed\nalias param probe.0.gain factor\nsetp speed 2\ngetp "
           "probe.0.in\nlist pin\nlist param factor\nshow alias\n",
           "2\nprobe.0.count probe.0.io probe.0.out probe.0.time probe.0.word speed \nfactor \n"
           "Pin Aliases:\n Alias                                            Original Name\n"
           " speed                                            probe.0.in\n\n"
           "Parameter Aliases:\n Alias                                            Original Name\n"
           " factor                                           probe.0.gain\n\n");
    refuse("alias pin probe.0.out speed", "already a pin or alias 'speed'");
    refuse("alias pin nothing x", "there is no pin 'nothing'");
    expect("unalias pin speed\nlist pin s\n", "\n");
    refuse("unalias pin speed", "there is no pin 'speed'");
}

static void tables_are_halcmds(void **state)
{
    (void)state;
    expect("loadrt probe\nsetp probe.0.in -123.456789\nsetp probe.0.word 0xAB\nsetp probe.0.io 1\nnet s probe.0.in\n"
           "show pin\n",
           "Component Pins:\n"
           "Owner   Type  Dir         Value  Name\n"
           "     1  s32   OUT             0  probe.0.count\n"
           "     1  float IN      -123.4568  probe.0.in <== s\n"
           "     1  bit   I/O          TRUE  probe.0.io\n"
           "     1  float OUT             0  probe.0.out\n"
           "     1  s32   OUT             0  probe.0.time\n"
           "     1  u32   IN     0x000000AB  probe.0.word\n"
           "\n");
    expect("show param\n", "Parameters:\n"
                           "Owner   Type  Dir         Value  Name\n"
                           "     1  float RW            2.5  probe.0.gain\n"
                           "     1  s32   RO              0  probe.0.seen\n"
                           "     1  s32   RW              0  probe.0.tmax\n"
                           "     1  bit   RO          FALSE  probe.0.tmax-increased\n"
                           "\n");
    expect("loadrt threads name1=fast name2=slow period2=3000000 fp2=0\naddf probe.0 fast\nshow thread\nshow comp\n",
           "Realtime Threads:\n"
           "     Period  FP     Name               (     Time, Max-Time )\n"
           "    3000000  NO                   slow (        0,        0 )\n"
           "    1000000  YES                  fast (        0,        0 )\n"
           "                  1 probe.0\n"
           "\n"
           "Loaded HAL Components:\n"
           "ID      Type  Name                                            PID   State\n"
           "     4  RT    __slow                                                ready\n"
           "     3  RT    __fast                                                ready\n"
           "     2  RT    threads                                               ready\n"
           "     1  RT    probe                                                 ready\n"
           "\n");
    expect("show pin -t u32\nshow pin probe.0.i nothing\nlist pin *.time\nlist pin -tbit\nlist comp\nlist thread\n"
           "list funct\n",
           "Component Pins:\nOwner   Type  Dir         Value  Name\n"
           "     1  u32   IN     0x000000AB  probe.0.word\n\n"
           "Component Pins:\nOwner   Type  Dir         Value  Name\n"
           "     1  float IN      -123.4568  probe.0.in <== s\n"
           "     1  bit   I/O          TRUE  probe.0.io\n\n"
           "fast.time probe.0.time slow.time \nprobe.0.io \n__slow __fast threads probe \nslow fast \nprobe.0 \n");
}

/* What `save` prints, executed on an empty host, gives the same again. */
static void a_saved_configuration_can_be_restored(void **state)
{
    (void)state;
    char saved[4096];
    expect("loadrt threads name1=t\nloadrt probe sets=2 texts=\"a b\",c\naddf probe.1 t\naddf probe.0 t 1\nnewsig lone "
           "u32\nnet a probe.0.out => probe.1.in\nnet b probe.0.io probe.1.io\nsetp probe.0.gain 1.25\n"
           "alias param probe.1.gain g1\nalias pin probe.1.word w1\nsetp probe.0.in 7\n",
           "");
    expect("save allu\n", "# components\n"
                          "loadrt threads name1=t \n"
                          "#loadrt __t  (not loaded by loadrt, no args saved)\n"
                          "loadrt probe sets=2 texts=\"a b\",c \n"
                          "# pin aliases\n"
                          "alias pin probe.1.word w1\n"
                          "# param aliases\n"
                          "alias param probe.1.gain g1\n"
                          "# signals\n"
                          "newsig lone u32  \n"
                          "# nets\n"
                          "net a probe.0.out => probe.1.in\n"
                          "net b probe.0.io <=> probe.1.io\n"
                          "# parameter values\n"
                          "setp g1          2.5\n"
                          "setp probe.0.gain         1.25\n"
                          "setp probe.0.tmax            0\n"
                          "setp probe.1.tmax            0\n"
                          "setp t.tmax            0\n"
                          "# unconnected pin values\n"
                          "setp probe.0.in            7\n"
                          "setp probe.0.word   0x00000000\n"
                          "setp w1   0x00000000\n"
                          "# realtime thread/function links\n"
                          "addf probe.0 t\n"
                          "addf probe.1 t\n");
    snprintf(saved, sizeof saved, "%s", hal_rig_output());
    expect("unloadrt all\ndelsig all\n", "");
    expect(saved, "");
    expect("save allu\n", saved);
}

static void locks_forbid_changes(void **state)
{
    (void)state;
    expect("loadrt threads name1=t\nloadrt probe\nlock all\n", "");
    refuse("newsig a bit", "locked");
    refuse("net a probe.0.in", "locked");
    refuse("setp probe.0.in 1", "locked");
    refuse("addf probe.0 t", "locked");
    refuse("loadrt nosuch", "locked");
    refuse("start", "locked");
    expect("unlock all\nlock tune\nsetp probe.0.in 1\n", "");
    refuse("addf probe.0 t", "locked");
    expect("lock none\naddf probe.0 t\nstatus lock\n",
           "HAL locking status:\n  current lock value 0 (00)\n  HAL_LOCK_NONE - nothing is locked\n");
}

static void echo_and_print_speak(void **state)
{
    (void)state;
    expect("echo hello \"two words\" x\nprint\nprint \"a b\"\necho\nnewsig s bit # c\nunecho\nnewsig t bit\n",
           "hello two words x\nt.hal:2: HALCMD MSG: \nt.hal:3: HALCMD MSG: \"a b\"\nEcho on\n"
           "(5)<echo>: newsig s bit # c\n(6)<echo>: unecho\nEcho off\n");
    assert_string_equal(hal_rig_run("help net\n"), "");
    assert_non_null(strstr(hal_rig_output(), "net SIGNAL PIN..."));
    assert_string_equal(hal_rig_run("help\n"), "");
    assert_non_null(strstr(hal_rig_output(), "loadrt"));
}

static void every_command_has_help(void **state)
{
    (void)state;
    char names[64][64];
    size_t count = 0, at = 0;
    char name[64];
    while (hal_session_complete(hal_rig_session(), "", &at, name, sizeof name) && count < 64)
        snprintf(names[count++], sizeof names[0], "%s", name);
    assert_true(count > 30);
    for (size_t i = 0; i < count; i++) {
        char command[80];
        snprintf(command, sizeof command, "help %.60s\n", names[i]);
        assert_string_equal(hal_rig_run(command), "");
        assert_non_null(strstr(hal_rig_output(), names[i]));
        for (size_t other = 0; other < i; other++)
            assert_string_not_equal(names[i], names[other]);
    }
}

static void completion_knows_what_stands_where(void **state)
{
    (void)state;
    static const struct {
        const char *line, *names; /* separated by blanks */
    } rows[] = {
        {"uns", ""},
        {"setp probe.0.g", "probe.0.gain"},
        {"net a", "alpha"},
        {"net alpha probe.0.o", "probe.0.out"},
        {"net alpha probe.0.out => probe.0.wo", "probe.0.word"},
        {"addf p", "probe.0"},
        {"addf probe.0 th", "thread1"},
        {"delf probe.0 x", ""},
        {"unloadrt p", "probe"},
        {"loadrt thr", "threads"},
        {"show pa", "param"},
        {"newsig x fl", "float"},
        {"alias pin probe.0.i", "probe.0.in probe.0.io"},
        {"help stat", "status"},
        {"bogus p", ""},
        {"start p", ""},
    };
    expect("loadrt threads\nloadrt probe\nnewsig alpha bit\n", "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char name[64], found[256] = "";
        size_t at = 0;
        while (hal_session_complete(hal_rig_session(), rows[i].line, &at, name, sizeof name)) {
            const size_t used = strlen(found);
            snprintf(found + used, sizeof found - used, "%s%s", used ? " " : "", name);
        }
        if (strcmp(found, rows[i].names) != 0)
            fail_msg("%s: found '%s', expected '%s'", rows[i].line, found, rows[i].names);
    }
}

static void run_times_are_written_as_csv(void **state)
{
    (void)state;
    assert_string_equal(hal_rig_run("loadrt threads name1=t period1=200000\nloadrt probe\naddf probe.0 t\nstart\nrun "
                                    "0.05\nstop\nhistogram t\n"),
                        "");
    const struct hh_thread *const thread = hh_thread_find(hh_host(), "t");
    unsigned long long total = 0, count;
    char what[16];
    long long from_ns, to_ns;
    const char *at = hal_rig_output();
    assert_int_equal(strncmp(at, "thread,what,from_ns,to_ns,count\n", 32), 0);
    while ((at = strchr(at, '\n')) && sscanf(++at, "t,%15[a-z],%lld,%lld,%llu", what, &from_ns, &to_ns, &count) == 4) {
        assert_true(from_ns < to_ns);
        total += strcmp(what, "busy") == 0 ? count : 0;
    }
    assert_true(total > 0);
    assert_int_equal(total, atomic_load(&thread->cycles));
    assert_string_equal(hal_rig_run("timing\n"), "");
    assert_non_null(strstr(hal_rig_output(), "99.9 %"));
    assert_string_equal(hal_rig_run("timing reset\n"), "");
    assert_int_equal(atomic_load(&thread->cycles), 0);
    assert_int_equal(histogram_total(&thread->busy), 0);
}

#define RIG(test) cmocka_unit_test_setup_teardown(test, hal_rig_open, hal_rig_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG(errors_name_file_line_and_reason),
        RIG(the_first_error_ends_the_file),
        RIG(quit_ends_the_file_without_an_error),
        RIG(values_are_parsed_by_their_type),
        RIG(setp_respects_directions_and_links),
        RIG(net_links_all_or_nothing),
        RIG(old_link_commands_work),
        RIG(aliases_replace_names_in_tables),
        RIG(tables_are_halcmds),
        RIG(a_saved_configuration_can_be_restored),
        RIG(locks_forbid_changes),
        RIG(echo_and_print_speak),
        RIG(every_command_has_help),
        RIG(completion_knows_what_stands_where),
        RIG(run_times_are_written_as_csv),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
