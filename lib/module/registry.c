/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Every module type of this library. The watchdog comes first, it tells whether the card still drives its outputs;
 * ports come behind all types that claim pins; raw access has no descriptor and comes last.
 */
#include "module_types.h"

/* clang-format off */
const struct hm2_module_type *const hm2_module_types[] = {
    &hm2_watchdog_type,
    &hm2_encoder_type,
    &hm2_muxed_encoder_type,
    &hm2_resolver_type,
    &hm2_ssi_type,
    &hm2_biss_type,
    &hm2_fanuc_type,
    &hm2_pwmgen_type,
    &hm2_tppwm_type,
    &hm2_rcpwmgen_type,
    &hm2_oneshot_type,
    &hm2_periodm_type,
    &hm2_xy2mod_type,
    &hm2_stepgen_type,
    &hm2_inmux_type,
    &hm2_inm_type,
    &hm2_ssr_type,
    &hm2_outm_type,
    &hm2_sserial_type,
    &hm2_sserialb_type,
    &hm2_bspi_type,
    &hm2_uart_type,
    &hm2_uart_rx_type,
    &hm2_pktuart_type,
    &hm2_pktuart_rx_type,
    &hm2_dpll_type,
    &hm2_led_type,
    &hm2_ioport_type,
    &hm2_raw_type,
    NULL,
};
/* clang-format on */
