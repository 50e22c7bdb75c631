/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Every module model of the simulated card, one line each. */
#include "sim_card.h"

extern const struct sim_module_ops sim_hm2dpll_ops, sim_ioport_ops, sim_irq_ops, sim_led_ops, sim_stepgen_ops,
    sim_watchdog_ops;
extern const struct sim_module_ops sim_encoder_ops, sim_muxed_encoder_ops, sim_muxed_select_ops;

const struct sim_module_ops *const sim_models[] = {
    &sim_hm2dpll_ops, &sim_watchdog_ops, &sim_ioport_ops,        &sim_stepgen_ops,      &sim_led_ops,
    &sim_irq_ops,     &sim_encoder_ops,  &sim_muxed_encoder_ops, &sim_muxed_select_ops, NULL,
};
