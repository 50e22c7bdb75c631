/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The module types of this folder, one per file; registry.c puts them in order. Private to lib/module. */
#ifndef HM2_MODULE_TYPES_H
#define HM2_MODULE_TYPES_H

#include <hm2/module.h>

#endif
