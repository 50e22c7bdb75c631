/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Module and pin names as mesaflash prints them (flash tool reference 2.7). */
#include "names.h"

#include <stdio.h>

#include <hm2/idrom.h>

#define SLOTS 32u

static const struct tag_row {
    uint8_t tag;
    const char *text, *xml;                    /* NULL = the same */
    const char *pins[SLOTS], *xml_pins[SLOTS]; /* by pin number from 1; no xml_pins = the same */
} rows[] = {
    {0x00, "Null", NULL, {NULL}, {NULL}},
    {0x01, "IRQLogic", NULL, {NULL}, {NULL}},
    {0x02, "WatchDog", "Watchdog", {NULL}, {NULL}},
    {0x03, "IOPort", NULL, {NULL}, {NULL}},
    {0x04,
     "QCount",
     "Encoder",
     {"Quad-A", "Quad-B", "Quad-IDX", "Quad-IDXM", "Quad-Probe", "Shared-IDX"},
     {"Phase A", "Phase B", "Index", "Quad-IDXM", "Quad-Probe"}},
    {0x05,
     "StepGen",
     NULL,
     {"Step/Table1", "Dir/Table2", "Table3", "Table4", "Table5", "Table6", "Table7", "Table8", "Index", "Probe"},
     {NULL}},
    {0x06, "PWM", NULL, {"PWM", "Dir", "/Enable"}, {"PWM/Up", "Dir/Down", "/Enable"}},
    {0x07, "SPI", NULL, {"/Frame", "DOut", "SClk", "DIn"}, {NULL}},
    {0x08, "SSI", NULL, {"SClk", "SClkEn", "Data", "DAv"}, {"SClk", "SClkEn", "Din", "DAv"}},
    {0x09, "UARTTX", NULL, {"TXData", "TXEna"}, {"TXData", "TXEna", "NTXEna"}},
    {0x0A, "UARTRX", NULL, {"RXData"}, {NULL}},
    {0x0B, "AddrX", NULL, {NULL}, {NULL}},
    {0x0C,
     "MuxedQCount",
     NULL,
     {"MuxQ-A", "MuxQ-B", "MuxQ-IDX", "MuxQ-IDXM", "Quad-ProbeM", "Shared-IDX"},
     {"Muxed Phase A", "Muxed Phase B", "Muxed Index", "MuxQ-IDXM", "Quad-ProbeM", "Shared-IDX"}},
    {0x0D, "MuxedQCountSel", NULL, {"MuxSel0", "MuxSel1"}, {"Muxed Encoder Select 0", "Muxed Encoder select 1"}},
    {0x0E, "BufSPI", NULL, {"/Frame", "DOut", "SClk", "DIn", "CS0", "CS1", "CS2", "CS3"}, {NULL}},
    {0x0F, "DBufSPI", NULL, {NULL, "DOut", "SClk", "DIn", "/CS-FRM0", "/CS-FRM1", "/CS-FRM2", "/CS-FRM3"}, {NULL}},
    {0x10, "DPLL", NULL, {"Sync", "DDSMSB", "FOut", "PostOut", "SyncToggle"}, {NULL}},
    {0x11, "MuxQCntM", NULL, {"MuxQ-A", "MuxQ-B", "MuxQ-IDX", "MuxQ-IDXM", "Quad-ProbeM", "Shared-IDX"}, {NULL}},
    {0x12, "MuxQSelM", NULL, {"MuxSel0", "MuxSel1"}, {NULL}},
    {0x13, "TPPWM", NULL, {"PWMA", "PWMB", "PWMC", "NPWMA", "NPWMB", "NPWMC", "/ENA", "FAULT"}, {NULL}},
    {0x14, "WaveGen", NULL, {"PDMA", "PDMB", "Trig0", "Trig1", "Trig2", "Trig3"}, {NULL}},
    {0x15, "DAQFIFO", NULL, {"Data", "Strobe", "Full"}, {NULL}},
    {0x16, "BinOsc", NULL, {"OscOut"}, {NULL}},
    {0x17, "DMDMA", NULL, {NULL}, {NULL}},
    {0x18, "BISS", NULL, {"Clk", "ClkEn", "Din", "DAv", "TData", "STime"}, {NULL}},
    {0x1A, "DPLL", NULL, {NULL}, {NULL}},
    {0x1B, "PktUARTTX", NULL, {"TXData", "TXEna"}, {"TXData", "TXEna", "NTXEna"}},
    {0x1C, "PktUARTRX", NULL, {"RXData"}, {NULL}},
    {0x1E, "InMux", NULL, {"Addr0", "Addr1", "Addr2", "Addr3", "Addr4", "MuxData"}, {NULL}},
    {0x1F, "Sigma5Enc", NULL, {"TXData", "RXData", "TxEn"}, {NULL}},
    {0x23,
     "InM",
     NULL,
     {"Input0_EncA0", "Input1_EncB0", "Input2_EncA1", "Input3_EncB1", "Input4_EncA2", "Input5_EncB2", "Input6_EncA3",
      "Input7_EncB3", "Input8",       "Input9",       "Input10",      "Input11",      "Input12",      "Input13",
      "Input14",      "Input15",      "Input16",      "Input17",      "Input18",      "Input19",      "Input20",
      "Input21",      "Input22",      "Input23",      "Input24",      "Input25",      "Input26",      "Input27",
      "Input28",      "Input29",      "Input30",      "Input31"},
     {"Input0",  "Input1",  "Input2",  "Input3",  "Input4",  "Input5",  "Input6",  "Input7",
      "Input8",  "Input9",  "Input10", "Input11", "Input12", "Input13", "Input14", "Input15",
      "Input16", "Input17", "Input18", "Input19", "Input20", "Input21", "Input22", "Input23",
      "Input24", "Input25", "Input26", "Input27", "Input28", "Input29", "Input30", "Input31"}},
    {0x2A, "DataPainter", NULL, {"VidData", "VidClk"}, {NULL}},
    {0x2B, "XYMod", NULL, {"XData", "YData", "Clk", "Sync", "Status"}, {NULL}},
    {0x2C, "RCPWM", NULL, {"PWM"}, {NULL}},
    {0x2D,
     "OutM",
     NULL,
     {"Output0",  "Output1",  "Output2",  "Output3",  "Output4",  "Output5",  "Output6",  "Output7",
      "Output8",  "Output9",  "Output10", "Output11", "Output12", "Output13", "Output14", "Output15",
      "Output16", "Output17", "Output18", "Output19", "Output20", "Output21", "Output22", "Output23",
      "Output24", "Output25", "Output26", "Output27", "Output28", "Output29", "Output30", "Output31"},
     {NULL}},
    {0x40, "LocalIO", NULL, {NULL}, {NULL}},
    {0x80, "LED", NULL, {NULL}, {NULL}},
    {0xC0,
     "ResolverMod",
     NULL,
     {"PwrEn", "PDMP", "PDMM", "ADChan0", "ADChan1", "ADChan2", "SPICS", "SPIClk", "SPIDI0", "SPIDI1"},
     {NULL}},
    {0xC1, "SSerial", NULL, {"RXData", "TXData", "TXEn", "TestPin"}, {NULL}},
    {0xC2, "Twiddler", NULL, {"InBit", "IOBit", "OutBit"}, {NULL}},
    {0xC3, "SSR", NULL, {"Out", "AC Ref"}, {NULL}},
    {0xC6, "SSerialB", NULL, {"RXData", "TXData", "TXEn", "TestPin"}, {NULL}},
    {0xC7, "OneShot", NULL, {"Trigger1", "Trigger2", "Out1", "Out2"}, {NULL}},
    {0xC8, "Period", NULL, {"Input"}, {NULL}},
    {0xC9, "BufSPID", NULL, {"/Frame", "DOut", "SClk", "DIn", "CS0", "CS1", "CS2", "CS3"}, {NULL}},
};

static const struct tag_row *find(const uint8_t tag)
{
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (rows[i].tag == tag)
            return &rows[i];
    return NULL;
}

const char *tag_text(const uint8_t tag, const bool xml, char *const buf, const size_t size)
{
    const struct tag_row *const row = find(tag);
    if (row)
        return xml && row->xml ? row->xml : row->text;
    (void)snprintf(buf, size, "(unknown-gtag-%u)", tag);
    return buf;
}

/* Smart serial: the high nibble is the kind of pin, the low one its number from 1. */
static bool smart_serial_text(const struct hm2_pd *const pd, const struct tag_row *const row, char *const buf,
                              const size_t size)
{
    static const uint8_t kinds[] = {0x00, 0x80, 0x90, 0xA0};
    for (size_t i = 0; i < sizeof kinds; i++)
        if ((pd->secondary_pin & 0xF0u) == kinds[i]) {
            (void)snprintf(buf, size, "%s%d", row->pins[i], (pd->secondary_pin & 0x0F) - 1);
            return true;
        }
    return false;
}

/* Pins whose name is a word and their number. */
static bool numbered_text(const struct hm2_pd *const pd, char *const buf, const size_t size)
{
    const int pin = pd->secondary_pin, output = pin - 0x81;
    switch (pd->secondary_tag) {
    case HM2_GTAG_SSR:
        if (pin == 0xA0)
            (void)snprintf(buf, size, "AC Ref");
        else
            (void)snprintf(buf, size, "Out-%02d", output);
        return true;
    case HM2_GTAG_INMUX:
        (void)snprintf(buf, size, output >= 0 ? "Addr%d" : "Data%d", output >= 0 ? output : pin - 1);
        return true;
    case HM2_GTAG_OUTM:
        (void)snprintf(buf, size, "Output%d", output);
        return true;
    default:
        return false;
    }
}

const char *pin_text(const struct hm2_pd *const pd, const bool xml, char *const buf, const size_t size)
{
    const struct tag_row *const row = find(pd->secondary_tag);
    const unsigned slot = (pd->secondary_pin & 0x7Fu) - 1;
    const bool serial = pd->secondary_tag == HM2_GTAG_SSERIAL || pd->secondary_tag == HM2_GTAG_SSERIALB;
    if (serial && smart_serial_text(pd, row, buf, size))
        return buf;
    if (numbered_text(pd, buf, size))
        return buf;
    const char *const *const names = row && xml && row->xml_pins[0] ? row->xml_pins : row ? row->pins : NULL;
    if (names && slot < SLOTS && names[slot])
        return names[slot];
    if (slot == 0 && pd->secondary_tag == HM2_GTAG_DBSPI)
        (void)snprintf(buf, size, "Null%u", slot + 1);
    else
        (void)snprintf(buf, size, "Unknown-Gtag%u-Chan%u-Pin%u", pd->secondary_tag, pd->secondary_unit,
                       pd->secondary_pin);
    return buf;
}
