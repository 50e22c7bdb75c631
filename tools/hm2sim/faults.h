/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Faults of the network, as options and commands name them. */
#ifndef HM2SIM_FAULTS_H
#define HM2SIM_FAULTS_H

#include <hm2/sim.h>

/* "loss=0.05,dup=0.02,delay=100-300": 0, or an error with a sentence in diag. Faults that are not named become 0;
 * "none" is all of them 0. The seed is left alone. */
int faults_option(const char *text, struct sim_faults *faults, struct hm2_diag *diag);

#endif
