/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Names of module types and pin functions, as LinuxCNC's load-time listing prints them (register map 2.1, 4.1, 4.2). */
#include <hm2/idrom.h>

#include <stdio.h>

static const char *const tag_names[256] = {
    [0x00] = "None",
    [0x01] = "IRQLogic",
    [0x02] = "Watchdog",
    [0x03] = "IOPort",
    [0x04] = "Encoder",
    [0x05] = "StepGen",
    [0x06] = "PWMGen",
    [0x07] = "SPI",
    [0x08] = "SSI Encoder",
    [0x09] = "UART Transmit Channel",
    [0x0A] = "UART Receive Channel",
    [0x0B] = "TranslationRAM",
    [0x0C] = "Muxed Encoder",
    [0x0D] = "Muxed Encoder Select",
    [0x0E] = "Buffered SPI Interface",
    [0x0F] = "DBufSPI",
    [0x10] = "DPLL",
    [0x11] = "MuxQCntM",
    [0x12] = "MuxQSelM",
    [0x13] = "ThreePhasePWM",
    [0x14] = "WaveGen",
    [0x15] = "DAQFIFO",
    [0x16] = "BinOsc",
    [0x17] = "DMDMA",
    [0x18] = "BiSS Encoder",
    [0x19] = "Fanuc Abs Encoder",
    [0x1A] = "Hostmot2 DPLL",
    [0x1B] = "PktUART Transmit Channel",
    [0x1C] = "PktUART Receive Channel",
    [0x1D] = "Scaler Counter",
    [0x1E] = "InMux Input Mux",
    [0x1F] = "Sigma5Enc",
    [0x23] = "InM Input Module",
    [0x2A] = "Data Painter",
    [0x2B] = "xy2mod Galvo interface",
    [0x2C] = "RCPWMGen",
    [0x2D] = "OutM Output Module",
    [0x40] = "LocalIO",
    [0x80] = "LED",
    [0xC0] = "Resolver",
    [0xC1] = "Smart Serial Interface",
    [0xC2] = "Twiddler",
    [0xC3] = "SSR",
    [0xC4] = "CPDrive",
    [0xC5] = "DSAD",
    [0xC6] = "Smart Serial Interface B",
    [0xC7] = "OneShot",
    [0xC8] = "PeriodM",
    [0xC9] = "BufSPID",
};

const char *hm2_tag_name(const uint8_t gtag)
{
    return tag_names[gtag] ? tag_names[gtag] : "unknown";
}

struct pin_name {
    uint8_t tag, code;
    const char *name;
};

/* Register map 4.1, column "lcnc"; sorted by tag and code. */
static const struct pin_name pin_names[] = {
    {0x04, 0x01, "A"},
    {0x04, 0x02, "B"},
    {0x04, 0x03, "Index"},
    {0x04, 0x04, "IndexMask"},
    {0x04, 0x05, "Probe"},
    {0x04, 0x06, "Shared Index"},
    {0x05, 0x09, "Index"},
    {0x05, 0x0A, "Probe"},
    {0x05, 0x81, "Step"},
    {0x05, 0x82, "Direction"},
    {0x05, 0x83, "Table2Pin"},
    {0x05, 0x84, "Table3Pin"},
    {0x05, 0x85, "Table4Pin"},
    {0x05, 0x86, "Table5Pin"},
    {0x05, 0x87, "Table6Pin"},
    {0x05, 0x88, "Table7Pin"},
    {0x06, 0x81, "Out0 (PWM or Up)"},
    {0x06, 0x82, "Out1 (Dir or Down)"},
    {0x06, 0x83, "Not-Enable"},
    {0x07, 0x04, "In"},
    {0x07, 0x81, "Frame"},
    {0x07, 0x82, "Out"},
    {0x07, 0x83, "Clock"},
    {0x08, 0x03, "Data"},
    {0x08, 0x81, "Clock"},
    {0x08, 0x82, "ClockEnable"},
    {0x09, 0x81, "TX Data"},
    {0x09, 0x82, "Drv Enable"},
    {0x0A, 0x01, "RX Data"},
    {0x0C, 0x01, "Muxed A"},
    {0x0C, 0x02, "Muxed B"},
    {0x0C, 0x03, "Muxed Index"},
    {0x0C, 0x04, "Muxed IndexMask"},
    {0x0C, 0x05, "Muxed Probe"},
    {0x0C, 0x06, "Muxed Shared Index"},
    {0x0D, 0x81, "Mux Select 0"},
    {0x0D, 0x82, "Mux Select 1"},
    {0x0E, 0x04, "Serial In"},
    {0x0E, 0x81, "/Frame"},
    {0x0E, 0x82, "Serial Out"},
    {0x0E, 0x83, "Clock"},
    {0x0E, 0x85, "CS0"},
    {0x0E, 0x86, "CS1"},
    {0x0E, 0x87, "CS2"},
    {0x0E, 0x88, "CS3"},
    {0x0E, 0x89, "CS4"},
    {0x0E, 0x8A, "CS5"},
    {0x0E, 0x8B, "CS6"},
    {0x0E, 0x8C, "CS7"},
    {0x0F, 0x04, "Serial In"},
    {0x0F, 0x82, "Serial Out"},
    {0x0F, 0x83, "Clock"},
    {0x0F, 0x85, "CS0"},
    {0x0F, 0x86, "CS1"},
    {0x0F, 0x87, "CS2"},
    {0x0F, 0x88, "CS3"},
    {0x10, 0x01, "SynchIn"},
    {0x10, 0x82, "MSBOut"},
    {0x10, 0x83, "Fout"},
    {0x10, 0x84, "PostOut"},
    {0x10, 0x85, "SynchTog"},
    {0x13, 0x08, "Fault"},
    {0x13, 0x81, "PWM A"},
    {0x13, 0x82, "PWM B"},
    {0x13, 0x83, "PWM C"},
    {0x13, 0x84, "PWM /A"},
    {0x13, 0x85, "PWM /B"},
    {0x13, 0x86, "PWM /C"},
    {0x13, 0x87, "Enable"},
    {0x14, 0x81, "PDMAOut"},
    {0x14, 0x82, "PDMBOut"},
    {0x14, 0x83, "Trigger0"},
    {0x14, 0x84, "Trigger1"},
    {0x14, 0x85, "Trigger2"},
    {0x14, 0x86, "Trigger3"},
    {0x18, 0x03, "data"},
    {0x18, 0x81, "clock"},
    {0x18, 0x82, "clock-enable"},
    {0x19, 0x03, "Data"},
    {0x19, 0x81, "Rq"},
    {0x19, 0x82, "RqEn"},
    {0x19, 0x84, "TestClk"},
    {0x1A, 0x01, "Sync In Pin"},
    {0x1A, 0x82, "Ref Out Pin"},
    {0x1A, 0x83, "Timer 1 Pin"},
    {0x1A, 0x84, "Timer 2 Pin"},
    {0x1A, 0x85, "Timer 3 Pin"},
    {0x1A, 0x86, "Timer 4 Pin"},
    {0x1B, 0x81, "TX Data"},
    {0x1B, 0x82, "Drv Enable low"},
    {0x1B, 0x83, "Drv Enable high"},
    {0x1C, 0x01, "RX Data"},
    {0x23, 0x01, "in0,enca0"},
    {0x23, 0x02, "in1,encb0"},
    {0x23, 0x03, "in2,enca1"},
    {0x23, 0x04, "in3,encb1"},
    {0x23, 0x05, "in4,enca2"},
    {0x23, 0x06, "in5,encb2"},
    {0x23, 0x07, "in6,enca3"},
    {0x23, 0x08, "in7,encb3"},
    {0x2B, 0x05, "status"},
    {0x2B, 0x81, "datax"},
    {0x2B, 0x82, "datay"},
    {0x2B, 0x83, "clk"},
    {0x2B, 0x84, "sync"},
    {0x2C, 0x81, "PWM"},
    {0xC0, 0x09, "SPIDO0"},
    {0xC0, 0x0A, "SPIDO1"},
    {0xC0, 0x81, "NC"},
    {0xC0, 0x82, "REFPDM+"},
    {0xC0, 0x83, "REFPDM-"},
    {0xC0, 0x84, "AMUX0"},
    {0xC0, 0x85, "AMUX1"},
    {0xC0, 0x86, "AMUX2"},
    {0xC0, 0x87, "SPICS"},
    {0xC0, 0x88, "SPICLK"},
    {0xC0, 0x89, "SPIDO0"},
    {0xC7, 0x01, "trigger1"},
    {0xC7, 0x02, "trigger2"},
    {0xC7, 0x83, "out1"},
    {0xC7, 0x84, "out2"},
    {0xC8, 0x01, "input"},
};

/* Families of numbered pins (register map 4.2): number = code - first + start, printed with so many digits; no digits =
 * the name alone. */
struct pin_range {
    uint8_t tag, first, last, start, digits;
    const char *name;
};

static const struct pin_range pin_ranges[] = {
    {0xC1, 0x01, 0x0F, 0, 1, "rx"},      {0xC1, 0x81, 0x8F, 0, 1, "tx"},
    {0xC1, 0x91, 0x9F, 0, 1, "txen"},    {0xC1, 0xA1, 0xAF, 0, 1, "ntxen"},
    {0xC6, 0x01, 0x0F, 0, 1, "rx"},      {0xC6, 0x81, 0x8F, 0, 1, "tx"},
    {0xC6, 0x91, 0x9F, 0, 1, "txen"},    {0xC6, 0xA1, 0xAF, 0, 1, "ntxen"},
    {0xC3, 0x81, 0x9F, 0, 2, "Out-"},    {0xC3, 0xA0, 0xA0, 0, 0, "AC Ref (internal)"},
    {0x2D, 0x81, 0x9F, 0, 2, "Out-"},    {0x1E, 0x81, 0x85, 0, 1, "addr"},
    {0x1E, 0x01, 0x01, 0, 0, "muxdata"}, {0x23, 0x09, 0x20, 8, 1, "in"},
    {0x15, 0x01, 0x1E, 0, 2, "Data"},    {0x15, 0x41, 0x41, 0, 0, "Strobe"},
    {0x15, 0x81, 0x81, 0, 0, "Full"},    {0x16, 0x81, 0x9F, 0, 2, "Out"},
    {0xC2, 0x01, 0x1F, 0, 2, "In"},      {0xC2, 0x81, 0x9F, 0, 2, "Out"},
    {0xC2, 0xC1, 0xDF, 0, 2, "IO"},
};

static const char *range_name(const struct hm2_pd *const pd, char *const buf, const size_t size)
{
    for (size_t i = 0; i < sizeof pin_ranges / sizeof pin_ranges[0]; i++) {
        const struct pin_range *const range = pin_ranges + i;
        if (pd->secondary_tag != range->tag || pd->secondary_pin < range->first || pd->secondary_pin > range->last)
            continue;
        if (range->digits == 0)
            return range->name;
        (void)snprintf(buf, size, "%s%0*u", range->name, range->digits,
                       (unsigned)pd->secondary_pin - range->first + range->start);
        return buf;
    }
    return NULL;
}

const char *hm2_pin_function(const struct hm2_pd *const pd, char *const buf, const size_t size)
{
    if (pd->secondary_tag == HM2_GTAG_NONE)
        return "GPIO";
    for (size_t i = 0; i < sizeof pin_names / sizeof pin_names[0]; i++)
        if (pin_names[i].tag == pd->secondary_tag && pin_names[i].code == pd->secondary_pin)
            return pin_names[i].name;
    const char *const name = range_name(pd, buf, size);
    if (name)
        return name;
    (void)snprintf(buf, size, "unknown-pin-%u", pd->secondary_pin & 0x7Fu);
    return buf;
}

unsigned hm2_connector_pin(const uint32_t port_width, const unsigned io)
{
    static const uint8_t db25[17] = {1, 14, 2, 15, 3, 16, 4, 17, 5, 6, 7, 8, 9, 10, 11, 12, 13};
    switch (port_width) {
    case 24:
        return 2 * (io % 24) + 1;
    case 17:
        return db25[io % 17];
    case 19:
    case 21:
    case 27:
    case 29:
    case 30:
    case 32:
        return io + 1;
    default:
        return 0;
    }
}
