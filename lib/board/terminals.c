/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Terminal names of daughter boards and of cards with terminals of their own (flash tool reference 2.6; as mesaflash
 * 3.5.16 has them, oddities included: programs compare them). The 7I49 is not in that table. */
#include <hm2/terminals.h>

#include <strings.h>

static const char *const t_7i76[] = {
    "TB2-4,5",   "TB2-2,3",   "TB2-10,11", "TB2-8,9",           "TB2-16,17",         "TB2-14,15", "TB2-22,23",
    "TB2-20,21", "TB3-4,5",   "TB3-2,3",   "Internal-Field-IO", "Internal-Field-IO", "TB3-18,19", "TB3-16,17",
    "TB3-13,14", "TB3-10,11", "TB3-7,8"};
static const char *const t_7i77[] = {
    "Internal-TXEn",     "TB6-5,6",           "TB6-3,4",           "Internal-Analog-IO", "Internal-Analog-IO",
    "Internal-Field-IO", "Internal-Field-IO", "Internal-EncMux",   "TB3-1,2,9,10",       "TB3-4,5,12,13",
    "TB3-7,8,15,16",     "TB3-17,18,TB4-1,2", "TB3-20,21,TB4-4,5", "TB3-23,24,TB4-7,8",  "TB4-9,10,17,18",
    "TB4-12,13,20,21",   "TB4-15,16,23,24"};
static const char *const t_7i94_0[] = {
    "P1-01/DB25-01", "P1-02/DB25-14", "P1-03/DB25-02", "P1-04/DB25-15", "P1-05/DB25-03", "P1-06/DB25-16",
    "P1-07/DB25-04", "P1-08/DB25-17", "P1-09/DB25-05", "P1-11/DB25-06", "P1-13/DB25-07", "P1-15/DB25-08",
    "P1-17/DB25-09", "P1-19/DB25-10", "P1-21/DB25-11", "P1-23/DB25-12", "P1-25/DB25-13", "J6 1,2",
    "J6 3,6",        "J6 TXEN",       "J7 1,2"};
static const char *const t_7i94_1[] = {"J7-3,6",  "J7-TXEN", "J8-1,2",  "J8-3,6",  "J8-TXEN", "J9-1,2",  "J9-3,6",
                                       "J9-TXEN", "J4-1,2",  "J4-3,6",  "J4-TXEN", "J3-1,2",  "J3-3,6",  "J3-TXEN",
                                       "J2-1,2",  "J2-3,6",  "J2-TXEN", "J1-1,2",  "J1-3,6",  "J1-TXEN", "P2-/ENA"};
static const char *const t_7i95_0[] = {
    "TB3-2,3",         "TB3-4,5",           "TB3-8,9",           "TB3-10,11",         "TB3-14,15",
    "TB3-16,17",       "TB3-20,21",         "TB3-22,23",         "TB4-2,3",           "TB4-4,5",
    "TB4-8,9",         "TB4-10,11",         "TB2-14,15",         "TB4-16,17",         "Internal-TXen",
    "TB4-20,21",       "TB4-22,23",         "Internal-TXen",     "TB1-1,2,9,10",      "TB1-4,5,12,13",
    "TB1-7,8,15,16",   "TB1-17,18 TB2-1,2", "TB1-20,21 TB2-4,5", "TB1-23,24,TB2-7,8", "TB2-9,10,17,18",
    "TB2-11,12,20,21", "TB2-15,16,23,24",   "Internal-EncMux",   "TB5-1,12, TB6-1,24"};
static const char *const t_7i95_1[] = {
    "TB5-1,12, TB6-1,24", "TB5-1,12, TB6-1,24", "TB5-1,12, TB6-1,24", "TB5-1,12, TB6-1,24", "TB5-1,12, TB6-1,24",
    "TB5-13,14",          "TB5-15,16",          "TB5-17,18",          "TB5-19,20",          "TB5-21,22",
    "TB5-23,24",          "Internal-SSR",       "P1-01/DB25-01",      "P1-02/DB25-14",      "P1-03/DB25-02",
    "P1-04/DB25-15",      "P1-05/DB25-03",      "P1-06/DB25-16",      "P1-07/DB25-04",      "P1-08/DB25-17",
    "P1-09/DB25-05",      "P1-11/DB25-06",      "P1-13/DB25-07",      "P1-15/DB25-08",      "P1-17/DB25-09",
    "P1-19/DB25-10",      "P1-21/DB25-11",      "P1-23/DB25-12",      "P1-25/DB25-13"};
static const char *const t_7i96_0[] = {"TB3-1",     "TB3-2",     "TB3-3",     "TB3-4",     "TB3-5",    "TB3-6",
                                       "TB3-7",     "TB3-8",     "TB3-9",     "TB3-10",    "TB3-11",   "TB3-13,14",
                                       "TB3-15,16", "TB3-17,18", "TB3-19,20", "TB3-21,22", "TB3-23,24"};
static const char *const t_7i96_1[] = {
    "TB1-2,3", "TB1-4,5", "TB1-8,9",   "TB1-10,11", "TB1-14,15", "TB1-16,17", "TB1-20,21",     "TB1-22,23",   "TB2-2,3",
    "TB2-4,5", "TB2-7,8", "TB2-10,11", "TB2-13,14", "TB2-16,17", "TB2-18,19", "Internal-TXEn", "Internal-SSR"};
static const char *const t_7i96_2[] = {
    "P1-01/DB25-01", "P1-02/DB25-14", "P1-03/DB25-02", "P1-04/DB25-15", "P1-05/DB25-03", "P1-06/DB25-16",
    "P1-07/DB25-04", "P1-08/DB25-17", "P1-09/DB25-05", "P1-11/DB25-06", "P1-13/DB25-07", "P1-15/DB25-08",
    "P1-17/DB25-09", "P1-19/DB25-10", "P1-21/DB25-11", "P1-23/DB25-12", "P1-25/DB25-13"};
static const char *const t_7i97_0[] = {"TB3-4",
                                       "TB3-8",
                                       "TB3-12",
                                       "TB3-16",
                                       "TB3-20",
                                       "TB3-20",
                                       "TB3-24",
                                       "TB3-24",
                                       "TB3-4,8,12,16",
                                       "TB1-1,2,9,10",
                                       "TB1-4,5,12,13",
                                       "TB1-7,8,15,16",
                                       "TB1-17,18,TB2-1,2",
                                       "TB1-20,21,TB2-4,5",
                                       "TB1-23,24,TB2-7,8",
                                       "TB2-9,10,17,18",
                                       "TB2-12,13,20,21"};
static const char *const t_7i97_1[] = {
    "TB2-15,16,23,24",    "Internal-EncMux",    "TB5-13,14",          "TB5-15,16",          "TB5-17,18",
    "TB5-19,20",          "TB5-21,22",          "TB5-23,24",          "Internal-SSR",       "TB4-1,12, TB5-1,12",
    "TB4-1,12, TB5-1,12", "TB4-1,12, TB5-1,12", "TB4-1,12, TB5-1,12", "TB4-1,12, TB5-1,12", "TB4-15,16",
    "TB4-17,18",          "Internal-TXEn"};
static const char *const t_7i97_2[] = {
    "P1-01/DB25-01", "P1-02/DB25-14", "P1-03/DB25-02", "P1-04/DB25-15", "P1-05/DB25-03", "P1-06/DB25-16",
    "P1-07/DB25-04", "P1-08/DB25-17", "P1-09/DB25-05", "P1-11/DB25-06", "P1-13/DB25-07", "P1-15/DB25-08",
    "P1-17/DB25-09", "P1-19/DB25-10", "P1-21/DB25-11", "P1-23/DB25-12", "P1-25/DB25-13"};
static const char *const t_7c80_0[] = {"TB7-2,3",
                                       "TB7-4,5",
                                       "TB8-2,3",
                                       "TB8-4,5",
                                       "TB9-2,3",
                                       "TB9-4,5",
                                       "TB10-2,3",
                                       "TB10-4,5",
                                       "TB11-2,3",
                                       "TB11-4,5",
                                       "TB12-2,3",
                                       "TB13-4,5",
                                       "TB3-3,4",
                                       "TB3-5,6",
                                       "Internal-TXen",
                                       "TB4-1,2",
                                       "TB4-4,5",
                                       "TB4-7,8",
                                       "TB5-2",
                                       "TB5-2",
                                       "TB5-5,6",
                                       "TB5-7,8",
                                       "TB1-1,24, TB2-1,2",
                                       "TB1-1,24, TB2-1,2",
                                       "TB1-1,24, TB2-1,2",
                                       "TB1-1,24, TB2-1,2",
                                       "TB1-1,24, TB2-1,2"};
static const char *const t_7c80_1[] = {
    "TB1-1,24, TB2-1,2", "TB13-1,2",      "TB13-3,4",      "TB13-5,6",      "TB13-7,8",      "TB14-1,2",
    "TB14-3,4",          "TB14-5,6",      "TB14-7,8",      "Internal-SSR",  "P1-01/DB25-01", "P1-02/DB25-14",
    "P1-03/DB25-02",     "P1-04/DB25-15", "P1-05/DB25-03", "P1-06/DB25-16", "P1-07/DB25-04", "P1-08/DB25-17",
    "P1-09/DB25-05",     "P1-11/DB25-06", "P1-13/DB25-07", "P1-15/DB25-08", "P1-17/DB25-09", "P1-19/DB25-10",
    "P1-21/DB25-11",     "P1-23/DB25-12", "P1-25/DB25-13"};
static const char *const t_7c81_0[] = {"P1-01/DB25-01", "P1-02/DB25-14", "P1-03/DB25-02", "P1-04/DB25-15",
                                       "P1-05/DB25-03", "P1-06/DB25-16", "P1-07/DB25-04", "P1-08/DB25-17",
                                       "P1-09/DB25-05", "P1-11/DB25-06", "P1-13/DB25-07", "P1-15/DB25-08",
                                       "P1-17/DB25-09", "P1-19/DB25-10", "P1-21/DB25-11", "P1-23/DB25-12",
                                       "P1-25/DB25-13", "P5 3,6",        "P6 3,6"};
static const char *const t_7c81_1[] = {"P2-01/DB25-01", "P2-02/DB25-14", "P2-03/DB25-02", "P2-04/DB25-15",
                                       "P2-05/DB25-03", "P2-06/DB25-16", "P2-07/DB25-04", "P2-08/DB25-17",
                                       "P2-09/DB25-05", "P2-11/DB25-06", "P2-13/DB25-07", "P2-15/DB25-08",
                                       "P2-17/DB25-09", "P2-19/DB25-10", "P2-21/DB25-11", "P2-23/DB25-12",
                                       "P2-25/DB25-13", "P5 TXEN",       "P6 TXEN"};
static const char *const t_7c81_2[] = {"P7-01/DB25-01", "P7-02/DB25-14", "P7-03/DB25-02", "P7-04/DB25-15",
                                       "P7-05/DB25-03", "P7-06/DB25-16", "P7-07/DB25-04", "P7-08/DB25-17",
                                       "P7-09/DB25-05", "P7-11/DB25-06", "P7-13/DB25-07", "P7-15/DB25-08",
                                       "P7-17/DB25-09", "P7-19/DB25-10", "P7-21/DB25-11", "P7-23/DB25-12",
                                       "P7-25/DB25-13", "P5 1,2",        "P6 1,2"};
static const char *const t_7i74[] = {"CHAN0-RX", "CHAN1-RX", "CHAN2-RX", "CHAN3-RX", "CHAN0-TX",  "CHAN1-TX",
                                     "CHAN2-TX", "CHAN3-TX", "CHAN4-RX", "CHAN5-RX", "CHAN6-RX",  "CHAN7-RX",
                                     "CHAN4-TX", "CHAN5-TX", "CHAN6-TX", "CHAN7-TX", "CHAN7-TXEn"};
static const char *const t_7i78[] = {"TB1-4,5",       "TB1-2,3",   "TB1-10,11", "TB1-8,9",   "TB1-16,17", "TB1-14,15",
                                     "TB1-22,23",     "TB1-20,21", "TB2-18",    "TB2-21,22", "TB2-23,24", "TB2-12,13",
                                     "Internal-TXEn", "TB2-10,11", "TB2-7,8",   "TB2-4,5",   "TB2-1,2"};
static const char *const t_7i85[] = {
    "TB1-19,20",     "TB1-21,22",     "TB1-11,12",         "TB1-13,14",         "TB1-3,4",          "TB1-5,6",
    "TB2-19,20",     "TB2-21,22",     "TB2-11,12",         "TB2-13,14",         "Internal-EncMux",  "TB3-1,2,9,10",
    "TB3-4,5,12,13", "TB3-7,8,12,13", "TB3-17,18,TB2-1,2", "TB3-20,21,TB2-4,5", "TB3-23,24,TB2-7,8"};
static const char *const t_7i85s[] = {
    "TB1-19,20",     "TB1-21,22",     "TB1-11,12",         "TB1-13,14",         "TB1-3,4",          "TB1-5,6",
    "TB2-19,20",     "TB2-21,22",     "TB2-11,12",         "TB2-13,14",         "Internal-EncMux",  "TB3-1,2,9,10",
    "TB3-4,5,12,13", "TB3-7,8,12,13", "TB3-17,18,TB2-1,2", "TB3-20,21,TB2-4,5", "TB3-23,24,TB2-7,8"};
static const char *const t_7i88[] = {"TB2-2,3",   "TB2-4,5",      "TB2-8,9",   "TB2-10,11", "TB2-14,15",
                                     "TB2-16,17", "TB2-20,21",    "TB2-22,23", "TB3-2,3",   "TB3-4,5",
                                     "TB3,8,9",   "TB3-10,11",    "TB3-13,14", "TB3-16,17", "TB3-20,21,Opt-TXEn",
                                     "TB3-22,23", "Opt-TB3-20,21"};
static const char *const t_7i89[] = {"TB3-1,2,9,10",      "TB3-4,5,12,13",     "TB2-7,8,15,16",  "TB3-17,18,TB2-1,2",
                                     "TB3-20,21,TB2-4,5", "TB3-23,24,TB2-7,8", "TB2-9,10,17,18", "TB2-12,13,20,21",
                                     "TB2-15,16,23,24",   "TB1-1,2,9,10",      "TB1-4,5,12,13",  "TB1-7,8,15,16",
                                     "Internal-EncMux",   "Internal-EncPower", "TB1-19,20",      "TB1-21,22",
                                     "Internal-TXEn"};
static const char *const t_dmm4250[] = {
    "Spindle-PWM", "Drive-Enable", "X-Dir",  "EStop-In", "X-Step", "Output-16",          "Y-Dir",
    "Output-17",   "Y-Step",       "Z-Dir",  "Z-Step",   "A-Dir",  "A-Step,Charge-Pump", "X-Limit",
    "Y-Limit",     "Z-Limit",      "A-Limit"};
static const char *const t_5abob[] = {"Spindle-PWM", "Drive-Enable", "X-Step",    "Input-P15", "X-Dir",    "B-Step",
                                      "Y-Step",      "B-Dir,Relay",  "Y-Dir",     "Z-Step",    "Z-Dir",    "A-Step",
                                      "A-Dir",       "Input-P10",    "Input-P11", "Input-P12", "Input-P13"};
static const char *const t_g540[] = {"Output-2", "Spindle-PWM", "X-Step",  "Fault",   "X-Dir",  "Charge-Pump",
                                     "Y-Step",   "Output-1",    "Y-Dir",   "Z-Step",  "Z-Dir",  "A-Step",
                                     "A-Dir",    "Input-1",     "Input-2", "Input-3", "Input-4"};
static const char *const t_c11[] = {"Relay-2", "Spindle-Rate", "Out-2",     "Input-P15", "Out-3",    "Relay-1",
                                    "Out-4",   "Charge-Pump",  "Out-5",     "Out-6",     "Out-7",    "Out-8",
                                    "Out-9",   "Input-P10",    "Input-P11", "Input-P12", "Input-P13"};
static const char *const t_c11g[] = {
    "Relay-3", "Spindle-PWM",         "Out-2",     "Input-P15", "Out-3",    "Spindle-Dir",
    "Out-4",   "Charge-Pump,Relay-3", "Out-5",     "Out-6",     "Out-7",    "Out-8",
    "Out-9",   "Input-P10",           "Input-P11", "Input-P12", "Input-P13"};
static const char *const t_7i33ta[] = {
    "TB2-4,5",    "TB2-1,2",    "TB1-4,5",    "TB1-1,2",    "TB2-7,8",    "TB1-7,8",    "TB2-10:PWM", "TB1-10:PWM",
    "TB2-10:Dir", "TB1-10:Dir", "TB2-12:Ena", "TB1-12:Ena", "TB2-16,17",  "TB2-13,14",  "TB1-16,17",  "TB1-13,14",
    "TB2-19,20",  "TB1-19,20",  "TB2-22:PWM", "TB1-22:PWM", "TB2-22:Dir", "TB1-22:Dir", "TB2-24:Ena", "TB1-24:Ena"};
static const char *const t_7i37ta[] = {"TB1-1,2",   "TB2-1,2",   "TB1-3,4",   "TB2-3,4",   "TB1-5,6",   "TB2-5,6",
                                       "TB1-7,8",   "TB2-7,8",   "TB1-9,10",  "TB2-9,10",  "TB1-11,12", "TB2-11,12",
                                       "TB1-13,14", "TB2-13,14", "TB1-15,16", "TB2-15,16", "TB1-17,18", "TB2-17,18",
                                       "TB1-19,20", "TB2-19,20", "TB1-21,22", "TB2-21,22", "TB1-23,24", "TB2-23,24"};
static const char *const t_7i44[] = {"CHAN0-RX", "CHAN1-RX",   "CHAN2-RX", "CHAN3-RX",   "CHAN0-TX", "CHAN0-TXEn",
                                     "CHAN1-TX", "CHAN1-TXEn", "CHAN2-TX", "CHAN2-TXEn", "CHAN3-TX", "CHAN3-TXEn",
                                     "CHAN4-RX", "CHAN5-RX",   "CHAN6-RX", "CHAN7-RX",   "CHAN4-TX", "CHAN4-TXEn",
                                     "CHAN5-TX", "CHAN5-TXEn", "CHAN6-TX", "CHAN6-TXEn", "CHAN7-TX", "CHAN7-TXEn"};
static const char *const t_7i47[] = {"P2-1,2",   "P2-4,5",   "P2-7,8",   "P2-10,11", "P4-1,2",   "P3-1,2",
                                     "P4-4,5",   "P3-4,5",   "P4-7,8",   "P3-7,8",   "P4-9,10",  "P3-9,10",
                                     "P4-12,13", "P3-12,13", "P4-15,16", "P3-15,16", "P2-13,14", "P2-16,17",
                                     "P2-19,20", "P2-22,23", "P4-19,20", "P4-22,23", "P3-19,20", "P3-22,23"};
static const char *const t_7i47s[] = {
    "P2-1,2",       "P2-4,5",       "P2-7,8",        "P2-10,11",  "P4-1,2",   "P3-1,2",   "P4-4,5",   "P3-4,5",
    "P4-7,8",       "P3-7,8",       "P4-9,10",       "P3-9,10",   "P4-12,13", "P3-12,13", "P4-15,16", "P3-15,16",
    "P2-15,16:Aux", "P2-17,18:Dir", "P2-19,20:/Ena", "P2-23:PWM", "P4-19,20", "P4-22,23", "P3-19,20", "P3-22,23"};
static const char *const t_7i48[] = {
    "/Ena0",         "P4-1,2,9,10",  "P4-4,5,12,13",  "P4-7,8,15,16", "P3-1,2,9,10",     "P3-4,5,12,13",
    "P3-7,8,15,16",  "P2-1,2,9,10",  "P2-4,5,12,13",  "P2-7,8,15,16", "Internal-EncMux", "P4-20:PWM-Up",
    "P4-20:PWM-Dwn", "P4-24:PWM-Up", "P4-24:PWM-Dwn", "P3-20:PWM-Up", "P3-20:PWM-Dwn",   "P3-24:PWM-Up",
    "P3-24:PWM-Dwn", "P2-20:PWM-Up", "P2-20:PWM-Dwn", "P2-24:PWM-Up", "P2-24:PWM-Dwn",   "/Ena1"};
/* Analog outputs: Mesa's "7I49 Manual", connectors P4 to P2, as quoted by page in the public wiring tables of
 * agant172/mazak-vqc20-linuxcnc-retrofit ("7i49 Analog Command Channel Plan", plane_b_pin_crosswalk.csv). Functions of
 * the pins: PIN_SV6_7I49_72.vhd; those of the resolvers' converter lead to no terminal. */
static const char *const t_7i49[] = {"/Enable",           "Internal-Resolver", "Internal-Resolver", "Internal-Resolver",
                                     "Internal-Resolver", "Internal-Resolver", "Internal-Resolver", "Internal-Resolver",
                                     "Internal-Resolver", "Internal-Resolver", "Internal-Resolver", "P4-20:PWM-Up",
                                     "P4-20:PWM-Dwn",     "P4-24:PWM-Up",      "P4-24:PWM-Dwn",     "P3-20:PWM-Up",
                                     "P3-20:PWM-Dwn",     "P3-24:PWM-Up",      "P3-24:PWM-Dwn",     "P2-20:PWM-Up",
                                     "P2-20:PWM-Dwn",     "P2-24:PWM-Up",      "P2-24:PWM-Dwn",     "/Enable"};
static const char *const t_7i52[] = {
    "P2-5,6:/Ena",     "P5-1,2,9,10",   "P5-4,5,12,13",   "P5-7,8,15,16",   "P5-17,18,P4-1,2", "P5-20,21,P4-4,5",
    "P5-23,24,P4-7,8", "P3-9,10,17,18", "P3-12,13,20,21", "P3-15,16,23,24", "Internal-EncMux", "P2-21,22",
    "P2-19,20",        "P2-13,14",      "P2-11,12",       "P2-5,6",         "P2-3,4",          "P3-21,22",
    "P3-19,20",        "P3-13,14",      "P3-11,12",       "P3-5,6",         "P3-3,4",          "P3-5,6:/Ena"};
static const char *const t_7i52s[] = {
    "P2-5,6:/Ena",     "P5-1,2,9,10",   "P5-4,5,12,13",   "P5-7,8,15,16",   "P5-17,18,P4-1,2", "P5-20,21,P4-4,5",
    "P5-23,24,P4-7,8", "P3-9,10,17,18", "P3-12,13,20,21", "P3-15,16,23,24", "Internal-EncMux", "P2-21,22",
    "P2-19,20",        "P2-13,14",      "P2-11,12",       "P2-5,6",         "P2-3,4",          "P3-21,22",
    "P3-19,20",        "P3-13,14",      "P3-11,12",       "P3-5,6",         "P3-3,4",          "P3-5,6:/Ena"};
static const char *const t_mx3660[] = {"Output2", "PWM",     "X-Step", "Fault",  "X-Dir", "Charge-Pump",
                                       "Y-Step",  "Output1", "Y-Dir",  "Z-Step", "Z-Dir", "Output3",
                                       "Output4", "Input1",  "Input2", "Input3", "Input4"};
static const char *const t_mx4660_1[] = {"Output2", "PWM",     "X-Step", "Fault",  "X-Dir", "Charge-Pump",
                                         "Y-Step",  "Output1", "Y-Dir",  "Z-Step", "Z-Dir", "A-Step",
                                         "A-Dir",   "Input1",  "Input2", "Input3", "Input4"};
static const char *const t_mx4660_2[] = {"Output6", "NC",      "NC",     "NC",     "NC",    "NC",
                                         "NC",      "Output5", "NC",     "NC",     "NC",    "Output3",
                                         "Output4", "Input5",  "Input6", "Input7", "Input8"};
static const char *const t_7i75[] = {"TB3-1",  "TB2-1",  "TB3-3",  "TB2-3",  "TB3-5",  "TB2-5",
                                     "TB3-7",  "TB2-7",  "TB3-9",  "TB2-9",  "TB3-11", "TB2-11",
                                     "TB3-13", "TB2-13", "TB3-15", "TB2-15", "TB3-17"};
static const char *const t_benezan[] = {"Spindle/PWM/Relay1",
                                        "Relay2",
                                        "X-Dir",
                                        "4th-Axis-Limit",
                                        "X-Step",
                                        "WD/Current-Reduce",
                                        "Y-Dir",
                                        "PWM/Current-Reduce",
                                        "Y-Step",
                                        "Z-Dir",
                                        "Z-Step",
                                        "4th-Axis-Dir",
                                        "4th-axis-Step",
                                        "Z-Limit",
                                        "EStop",
                                        "Y-Limit",
                                        "X-Limit"};
static const char *const t_hdr26[] = {"1",  "2",  "3",  "4",  "5",  "6",  "7",  "8", "9",
                                      "11", "13", "15", "17", "19", "21", "23", "25"};

static const struct hm2_terminals tables[] = {
    {"7I76", sizeof t_7i76 / sizeof t_7i76[0], t_7i76},
    {"7I77", sizeof t_7i77 / sizeof t_7i77[0], t_7i77},
    {"7I94_0", sizeof t_7i94_0 / sizeof t_7i94_0[0], t_7i94_0},
    {"7I94_1", sizeof t_7i94_1 / sizeof t_7i94_1[0], t_7i94_1},
    {"7I95_0", sizeof t_7i95_0 / sizeof t_7i95_0[0], t_7i95_0},
    {"7I95_1", sizeof t_7i95_1 / sizeof t_7i95_1[0], t_7i95_1},
    {"7I96_0", sizeof t_7i96_0 / sizeof t_7i96_0[0], t_7i96_0},
    {"7I96_1", sizeof t_7i96_1 / sizeof t_7i96_1[0], t_7i96_1},
    {"7I96_2", sizeof t_7i96_2 / sizeof t_7i96_2[0], t_7i96_2},
    {"7I97_0", sizeof t_7i97_0 / sizeof t_7i97_0[0], t_7i97_0},
    {"7I97_1", sizeof t_7i97_1 / sizeof t_7i97_1[0], t_7i97_1},
    {"7I97_2", sizeof t_7i97_2 / sizeof t_7i97_2[0], t_7i97_2},
    {"7C80_0", sizeof t_7c80_0 / sizeof t_7c80_0[0], t_7c80_0},
    {"7C80_1", sizeof t_7c80_1 / sizeof t_7c80_1[0], t_7c80_1},
    {"7C81_0", sizeof t_7c81_0 / sizeof t_7c81_0[0], t_7c81_0},
    {"7C81_1", sizeof t_7c81_1 / sizeof t_7c81_1[0], t_7c81_1},
    {"7C81_2", sizeof t_7c81_2 / sizeof t_7c81_2[0], t_7c81_2},
    {"7I74", sizeof t_7i74 / sizeof t_7i74[0], t_7i74},
    {"7I78", sizeof t_7i78 / sizeof t_7i78[0], t_7i78},
    {"7I85", sizeof t_7i85 / sizeof t_7i85[0], t_7i85},
    {"7I85S", sizeof t_7i85s / sizeof t_7i85s[0], t_7i85s},
    {"7I88", sizeof t_7i88 / sizeof t_7i88[0], t_7i88},
    {"7I89", sizeof t_7i89 / sizeof t_7i89[0], t_7i89},
    {"DMM4250", sizeof t_dmm4250 / sizeof t_dmm4250[0], t_dmm4250},
    {"5ABOB", sizeof t_5abob / sizeof t_5abob[0], t_5abob},
    {"G540", sizeof t_g540 / sizeof t_g540[0], t_g540},
    {"C11", sizeof t_c11 / sizeof t_c11[0], t_c11},
    {"C11G", sizeof t_c11g / sizeof t_c11g[0], t_c11g},
    {"7I33TA", sizeof t_7i33ta / sizeof t_7i33ta[0], t_7i33ta},
    {"7I37TA", sizeof t_7i37ta / sizeof t_7i37ta[0], t_7i37ta},
    {"7I44", sizeof t_7i44 / sizeof t_7i44[0], t_7i44},
    {"7I47", sizeof t_7i47 / sizeof t_7i47[0], t_7i47},
    {"7I47S", sizeof t_7i47s / sizeof t_7i47s[0], t_7i47s},
    {"7I48", sizeof t_7i48 / sizeof t_7i48[0], t_7i48},
    {"7I49", sizeof t_7i49 / sizeof t_7i49[0], t_7i49},
    {"7I52", sizeof t_7i52 / sizeof t_7i52[0], t_7i52},
    {"7I52S", sizeof t_7i52s / sizeof t_7i52s[0], t_7i52s},
    {"MX3660", sizeof t_mx3660 / sizeof t_mx3660[0], t_mx3660},
    {"MX4660-1", sizeof t_mx4660_1 / sizeof t_mx4660_1[0], t_mx4660_1},
    {"MX4660-2", sizeof t_mx4660_2 / sizeof t_mx4660_2[0], t_mx4660_2},
    {"7I75", sizeof t_7i75 / sizeof t_7i75[0], t_7i75},
    {"BENEZAN", sizeof t_benezan / sizeof t_benezan[0], t_benezan},
    {"HDR26", sizeof t_hdr26 / sizeof t_hdr26[0], t_hdr26},
};

const struct hm2_terminals *hm2_terminals_find(const char *const name)
{
    for (size_t i = 0; i < sizeof tables / sizeof tables[0]; i++)
        if (strcasecmp(name, tables[i].name) == 0)
            return &tables[i];
    return NULL;
}

const struct hm2_terminals *hm2_terminals_at(const size_t index)
{
    return index < sizeof tables / sizeof tables[0] ? &tables[index] : NULL;
}
