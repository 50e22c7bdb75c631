/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "suite.h"

int run_suite(Suite *const suite)
{
    SRunner *const runner = srunner_create(suite);
    srunner_run_all(runner, CK_ENV);
    const int failed = srunner_ntests_failed(runner);
    srunner_free(runner); /* and the suite */
    return failed > 0;
}
