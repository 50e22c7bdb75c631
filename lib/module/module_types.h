/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The module types of this folder, one per file; registry.c puts them in order. Private to lib/module. */
#ifndef HM2_MODULE_TYPES_H
#define HM2_MODULE_TYPES_H

#include <hm2/module.h>

extern const struct hm2_module_type hm2_biss_type;
extern const struct hm2_module_type hm2_bspi_type;
extern const struct hm2_module_type hm2_dpll_type;
extern const struct hm2_module_type hm2_encoder_type;
extern const struct hm2_module_type hm2_fanuc_type;
extern const struct hm2_module_type hm2_inm_type;
extern const struct hm2_module_type hm2_inmux_type;
extern const struct hm2_module_type hm2_ioport_type;
extern const struct hm2_module_type hm2_led_type;
extern const struct hm2_module_type hm2_muxed_encoder_type;
extern const struct hm2_module_type hm2_oneshot_type;
extern const struct hm2_module_type hm2_outm_type;
extern const struct hm2_module_type hm2_periodm_type;
extern const struct hm2_module_type hm2_pktuart_rx_type;
extern const struct hm2_module_type hm2_pktuart_type;
extern const struct hm2_module_type hm2_pwmgen_type;
extern const struct hm2_module_type hm2_raw_type;
extern const struct hm2_module_type hm2_sserial_type;
extern const struct hm2_module_type hm2_sserialb_type;
extern const struct hm2_module_type hm2_rcpwmgen_type;
extern const struct hm2_module_type hm2_resolver_type;
extern const struct hm2_module_type hm2_ssi_type;
extern const struct hm2_module_type hm2_ssr_type;
extern const struct hm2_module_type hm2_stepgen_type;
extern const struct hm2_module_type hm2_tppwm_type;
extern const struct hm2_module_type hm2_uart_rx_type;
extern const struct hm2_module_type hm2_uart_type;
extern const struct hm2_module_type hm2_watchdog_type;
extern const struct hm2_module_type hm2_xy2mod_type;

#endif
