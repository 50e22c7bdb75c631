/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/idrom.h>
#include <hm2/sslbp.h>

enum { REGISTER_CS = 2, REGISTER_USER = 3 }; /* numbers (register map 3.8.1) */

void sslbp_port_place(struct sslbp_port *const port, const struct hm2_md *const md, const unsigned instance)
{
    /* Command and data exist per instance although the descriptor's mask says nothing of them (register map 3.8.1). */
    port->command = (uint16_t)(md->base + instance * md->instance_stride);
    port->data = (uint16_t)(port->command + md->register_stride);
    port->cs = hm2_md_address(md, REGISTER_CS, instance);
    const unsigned users = md->registers > REGISTER_USER ? (unsigned)md->registers - REGISTER_USER : 0u;
    port->users = users < SSLBP_USER_WORDS ? users : SSLBP_USER_WORDS;
    for (unsigned i = 0; i < port->users; i++)
        port->user[i] = hm2_md_address(md, REGISTER_USER + i, instance);
}
