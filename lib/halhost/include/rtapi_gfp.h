/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Kinds of memory a caller may ask for. They are accepted for source compatibility and make no difference here. */
#ifndef RTAPI_GFP_H
#define RTAPI_GFP_H

enum rtapi_gfp_e {
    RTAPI_GFP_BUFFER,
    RTAPI_GFP_ATOMIC,
    RTAPI_GFP_KERNEL,
    RTAPI_GFP_USER,
    RTAPI_GFP_NOBUFFER,
    RTAPI_GFP_NFS,
    RTAPI_GFP_DMA
};

typedef unsigned long rtapi_gfp_t;

#endif
