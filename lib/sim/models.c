/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Every module model of the simulated card, one line each. */
#include "sim_card.h"

extern const struct sim_module_ops sim_bspi_ops;
extern const struct sim_module_ops sim_dbspi_ops;
extern const struct sim_module_ops sim_biss_ops;
extern const struct sim_module_ops sim_encoder_ops;
extern const struct sim_module_ops sim_fabs_ops;
extern const struct sim_module_ops sim_hm2dpll_ops;
extern const struct sim_module_ops sim_inm_ops;
extern const struct sim_module_ops sim_inmux_ops;
extern const struct sim_module_ops sim_oneshot_ops;
extern const struct sim_module_ops sim_outm_ops;
extern const struct sim_module_ops sim_spi_ops;
extern const struct sim_module_ops sim_ssr_ops;
extern const struct sim_module_ops sim_ioport_ops;
extern const struct sim_module_ops sim_irq_ops;
extern const struct sim_module_ops sim_led_ops;
extern const struct sim_module_ops sim_muxed_encoder_ops;
extern const struct sim_module_ops sim_muxed_select_ops;
extern const struct sim_module_ops sim_pktuart_rx_ops;
extern const struct sim_module_ops sim_pktuart_tx_ops;
extern const struct sim_module_ops sim_periodm_ops;
extern const struct sim_module_ops sim_pwmgen_ops;
extern const struct sim_module_ops sim_rcpwm_ops;
extern const struct sim_module_ops sim_resolver_ops;
extern const struct sim_module_ops sim_ssi_ops;
extern const struct sim_module_ops sim_stepgen_ops;
extern const struct sim_module_ops sim_sserial_ops;
extern const struct sim_module_ops sim_sserialb_ops;
extern const struct sim_module_ops sim_uart_rx_ops;
extern const struct sim_module_ops sim_uart_tx_ops;
extern const struct sim_module_ops sim_tppwm_ops;
extern const struct sim_module_ops sim_watchdog_ops;
extern const struct sim_module_ops sim_wavegen_ops;
extern const struct sim_module_ops sim_xy2mod_ops;

const struct sim_module_ops *const sim_models[] = {
    &sim_hm2dpll_ops,       /* 1A */
    &sim_ioport_ops,        /* 03 */
    &sim_irq_ops,           /* 01 */
    &sim_led_ops,           /* 80 */
    &sim_stepgen_ops,       /* 05 */
    &sim_watchdog_ops,      /* 02 */
    &sim_pwmgen_ops,        /* 06 */
    &sim_encoder_ops,       /* 04 */
    &sim_muxed_encoder_ops, /* 0C */
    &sim_muxed_select_ops,  /* 0D */
    &sim_inm_ops,           /* 23 */
    &sim_inmux_ops,         /* 1E */
    &sim_outm_ops,          /* 2D */
    &sim_ssr_ops,           /* C3 */
    &sim_sserial_ops,       /* C1 */
    &sim_sserialb_ops,      /* C6 */
    &sim_bspi_ops,          /* 0E */
    &sim_dbspi_ops,         /* 0F */
    &sim_spi_ops,           /* 07 */
    &sim_uart_tx_ops,       /* 09 */
    &sim_uart_rx_ops,       /* 0A */
    &sim_pktuart_tx_ops,    /* 1B */
    &sim_pktuart_rx_ops,    /* 1C */
    &sim_ssi_ops,           /* 08 */
    &sim_biss_ops,          /* 18 */
    &sim_fabs_ops,          /* 19 */
    &sim_tppwm_ops,         /* 13 */
    &sim_wavegen_ops,       /* 14 */
    &sim_rcpwm_ops,         /* 2C */
    &sim_periodm_ops,       /* C8 */
    &sim_resolver_ops,      /* C0 */
    &sim_oneshot_ops,       /* C7 */
    &sim_xy2mod_ops,        /* 2B */
    NULL,
};
