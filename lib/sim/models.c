/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Every module model of the simulated card, one line each. */
#include "sim_card.h"

const struct sim_module_ops *const sim_models[] = {
    NULL,
};
