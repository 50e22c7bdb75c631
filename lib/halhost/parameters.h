/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Parameters of a component and the "name=value" arguments that set them (hal-interface 5.5). */
#ifndef HALHOST_PARAMETERS_H
#define HALHOST_PARAMETERS_H

#include <stddef.h>

#include <hm2/err.h>

#define HH_PARAMETER_NAME_SIZE 64u
#define HH_PARAMETERS_MAX      128u

struct hh_parameter {
    char name[HH_PARAMETER_NAME_SIZE];
    char type; /* 'i', 'l' or 's' */
    void *address;
    int elements; /* 0 = a single value */
};

struct hh_parameters {
    struct hh_parameter *items;
    size_t count;
    void **texts; /* strings that were stored in variables of the component */
    size_t text_count;
};

int hh_parameters_add(struct hh_parameters *parameters, const char *name, char type, void *address, int elements,
                      struct hm2_diag *diag);
/* Split at the first "=", remove double quotes (and single ones around the whole value), split arrays at commas, and
 * store. An unknown name is refused with the list of the known ones. */
int hh_parameters_set(struct hh_parameters *parameters, const char *component, const char *argument,
                      struct hm2_diag *diag);
void hh_parameters_free(struct hh_parameters *parameters);

#endif
