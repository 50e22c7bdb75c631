/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Lines and words of HAL files; expected results were compared with halcmd of LinuxCNC 2.9. */
#include "unit.h"

#include "inifile.h"
#include "tokens.h"

static const char *environment(void *const context, const char *const name)
{
    (void)context;
    if (strcmp(name, "HOME") == 0)
        return "/home/x";
    if (strcmp(name, "TWO") == 0)
        return "one two";
    if (strcmp(name, "LONG") == 0) {
        static char text[HAL_LINE_MAX];
        memset(text, 'x', sizeof text - 1);
        return text;
    }
    return NULL;
}

static const char *ini(void *const context, const char *const section, const char *const name)
{
    (void)context;
    return strcmp(section, "A") == 0 && strcmp(name, "B") == 0 ? "1 2  # x" : NULL;
}

static const struct hal_variables variables = {environment, ini, NULL};

static void words_are_cut_as_halcmd_cuts_them(void **state)
{
    (void)state;
    static const struct {
        const char *line, *words; /* joined by "|" */
    } rows[] = {
        {"", ""},
        {"   \t ", ""},
        {"# only a comment", ""},
        {"   # another", ""},
        {"setp a 1", "setp|a|1"},
        {"  setp\ta   1  ", "setp|a|1"},
        {"setp a 1 # c", "setp|a|1"},
        {"print x#y", "print|x"},
        {"print \"a # b\"", "print|\"a # b\""},
        {"print 'don\"t'", "print|'don\"t'"},
        {"print a\"b c\"d", "print|a\"b c\"d"},
        {"print a\\ b", "print|a\\|b"},
        {"print x$HOME/y", "print|x/home/x/y"},
        {"print x$(HOME)y", "print|x/home/xy"},
        {"print \"$HOME x\"", "print|\"/home/x x\""},
        {"print $TWO", "print|one|two"},
        {"print [A]B", "print|1|2|#|x"},
        {"print [A](B)y", "print|1|2|#|xy"},
        {"print \"[A]B\"", "print|\"1 2  # x\""},
        {"net s a => b <= c", "net|s|a|=>|b|<=|c"},
    };
    static struct hal_tokens tokens;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hm2_diag diag = {0};
        char joined[512] = "";
        assert_int_equal(hal_tokens_parse(&tokens, rows[i].line, &variables, &diag), 0);
        for (size_t w = 0; w < tokens.count; w++) {
            const size_t used = strlen(joined);
            snprintf(joined + used, sizeof joined - used, "%s%s", w ? "|" : "", tokens.items[w]);
        }
        assert_string_equal(joined, rows[i].words);
    }
}

static void bad_lines_are_refused_with_the_reason(void **state)
{
    (void)state;
    static const struct {
        const char *line, *reason;
    } rows[] = {
        {"print \"abc", "not closed"},
        {"print 'abc\"", "not closed"},
        {"print $", "no name"},
        {"print ${HOME}", "no name"},
        {"print $()", "no name"},
        {"print $NOTSET", "'NOTSET' is not set"},
        {"print $HOME-z", "'HOME-z' is not set"}, /* halcmd counts "-" to the name, too */
        {"print $(HOME", "closing parenthesis"},
        {"print [A", "closing bracket"},
        {"print []B", "no name"},
        {"print [A](B", "closing parenthesis"},
        {"print [A]NOPE", "'[A]NOPE' is not set"},
        {"print $LONG$LONG", "longer than"},
    };
    static struct hal_tokens tokens;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hm2_diag diag = {0};
        assert_true(hal_tokens_parse(&tokens, rows[i].line, &variables, &diag) < 0);
        if (!strstr(diag.text, rows[i].reason))
            fail_msg("%s: got %s", rows[i].line, diag.text);
    }
}

static void too_many_words_are_refused(void **state)
{
    (void)state;
    static struct hal_tokens tokens;
    static char line[2 * (HAL_TOKENS_MAX + 1) + 1];
    for (size_t i = 0; i < HAL_TOKENS_MAX; i++)
        memcpy(line + 2 * i, "a ", 2);
    struct hm2_diag diag = {0};
    assert_int_equal(hal_tokens_parse(&tokens, line, &variables, &diag), 0);
    assert_int_equal(tokens.count, HAL_TOKENS_MAX);
    memcpy(line + 2 * HAL_TOKENS_MAX, "a", 2);
    assert_true(hal_tokens_parse(&tokens, line, &variables, &diag) < 0);
}

static void lines_without_variables_need_no_functions(void **state)
{
    (void)state;
    static struct hal_tokens tokens;
    const struct hal_variables none = {NULL, NULL, NULL};
    struct hm2_diag diag = {0};
    assert_int_equal(hal_tokens_parse(&tokens, "a b", &none, &diag), 0);
    assert_true(hal_tokens_parse(&tokens, "a $HOME", &none, &diag) < 0);
    assert_true(hal_tokens_parse(&tokens, "a [A]B", &none, &diag) < 0);
}

static void a_backslash_continues_a_line_and_its_first_line_counts(void **state)
{
    (void)state;
    static const char text[] = "one\\\ntwo\r\n\nthree\\\r\n four\nlast\\";
    static const struct {
        unsigned number;
        const char *text;
    } rows[] = {{1, "onetwo"}, {3, ""}, {4, "three four"}, {6, "last"}};
    struct hal_reader reader = {.at = text, .end = text + sizeof text - 1};
    static struct hal_line line;
    struct hm2_diag diag = {0};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(hal_reader_next(&reader, &line, &diag), 1);
        assert_int_equal(line.number, rows[i].number);
        assert_string_equal(line.text, rows[i].text);
    }
    assert_int_equal(hal_reader_next(&reader, &line, &diag), 0);
}

static void hostile_lines_are_refused(void **state)
{
    (void)state;
    static char text[HAL_LINE_MAX + 2];
    static struct hal_line line;
    struct hm2_diag diag = {0};
    memset(text, 'a', sizeof text);
    struct hal_reader reader = {.at = text, .end = text + HAL_LINE_MAX};
    assert_int_equal(hal_reader_next(&reader, &line, &diag), 1);
    reader = (struct hal_reader){.at = text, .end = text + HAL_LINE_MAX + 1};
    assert_true(hal_reader_next(&reader, &line, &diag) < 0);
    static const char nul[] = "a\0b\nc";
    reader = (struct hal_reader){.at = nul, .end = nul + sizeof nul - 1};
    assert_true(hal_reader_next(&reader, &line, &diag) < 0);
    /* Many continuations do not get around the limit. */
    for (size_t i = 1; i < sizeof text; i += 2) {
        text[i - 1] = '\\';
        text[i] = '\n';
    }
    reader = (struct hal_reader){.at = text, .end = text + sizeof text};
    assert_int_equal(hal_reader_next(&reader, &line, &diag), 1);
    assert_string_equal(line.text, "");
}

static void quotes_around_a_whole_word_are_removed(void **state)
{
    (void)state;
    static const struct {
        const char *word, *bare;
    } rows[] = {{"a", "a"},       {"\"a b\"", "a b"},   {"'a'", "a"}, {"\"", "\""},
                {"\"a'", "\"a'"}, {"a\"b\"", "a\"b\""}, {"\"\"", ""}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char word[16];
        snprintf(word, sizeof word, "%s", rows[i].word);
        assert_string_equal(hal_unquote(word), rows[i].bare);
    }
}

static void ini_files_are_read(void **state)
{
    (void)state;
    static const char text[] = "TOP = 0\n# c\n; c\n[A]\nB=1 2  # x  \r\nC = 5\n\n[ D ]\nB = other\nB = late\n";
    struct hm2_diag diag = {0};
    struct inifile *const file = inifile_parse(text, sizeof text - 1, "x.ini", &diag);
    assert_non_null(file);
    assert_string_equal(inifile_get(file, "A", "B"), "1 2  # x");
    assert_string_equal(inifile_get(file, "A", "C"), "5");
    assert_string_equal(inifile_get(file, "D", "B"), "other");
    assert_string_equal(inifile_get(file, "", "TOP"), "0");
    assert_null(inifile_get(file, "A", "D"));
    assert_null(inifile_get(file, "B", "B"));
    inifile_free(file);
    assert_null(inifile_parse("[A\n", 3, "x.ini", &diag));
    assert_non_null(strstr(diag.text, "x.ini:1:"));
    hm2_diag_clear(&diag);
    assert_null(inifile_parse("[A]\nwhat\n", 9, "x.ini", &diag));
    assert_non_null(strstr(diag.text, "x.ini:2:"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_are_cut_as_halcmd_cuts_them),
        cmocka_unit_test(bad_lines_are_refused_with_the_reason),
        cmocka_unit_test(too_many_words_are_refused),
        cmocka_unit_test(lines_without_variables_need_no_functions),
        cmocka_unit_test(a_backslash_continues_a_line_and_its_first_line_counts),
        cmocka_unit_test(hostile_lines_are_refused),
        cmocka_unit_test(quotes_around_a_whole_word_are_removed),
        cmocka_unit_test(ini_files_are_read),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
