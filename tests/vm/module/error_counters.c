// SPDX-License-Identifier: GPL-2.0-only
/*
 * Gives the SJA1000 controllers that QEMU emulates (kvaser_pci) the error counters that the emulation leaves out, so
 * that they can become error-passive and leave the bus as real ones do. Everything else is the kernel's own: the
 * driver's interrupt handler, the error frames, the carrier, the restart.
 *
 * Unlike the rest of the project, which is under its own licences, this file is under version 2 of the GNU General
 * Public License alone: it is linked with the driver's sja1000_interrupt(), which the kernel exports to no other.
 *
 *	echo "can0 transmit 12" > /sys/module/error_counters/parameters/errors
 *
 * lets twelve transmissions of can0 fail one after the other, and "can0 transmit -33" lets 33 succeed; "receive"
 * likewise. A failed transmission counts eight, everything else one (ISO 11898-1, fault confinement), and the chip
 * does on each what its data sheet says: from 96 on it warns, from 128 on it is error-passive, and beyond 255
 * transmit errors it enters the reset mode and is off the bus until its driver ends that mode. It comes back at once:
 * there is no wire on which to wait for 128 times eleven recessive bits.
 *
 *	echo "can0 alone 1" > /sys/module/error_counters/parameters/errors
 *
 * lets no other node acknowledge what can0 sends, so that its frame waits in the transmit buffer until "can0 alone 0".
 * The errors that this costs are to be counted beside it.
 */
#include <linux/can/dev.h>
#include <linux/if_arp.h>
#include <linux/interrupt.h>
#include <linux/kallsyms.h>
#include <linux/module.h>
#include <linux/netdevice.h>
#include <linux/rtnetlink.h>
#include <net/net_namespace.h>

/* Registers and bits of the PeliCAN mode, by their names in the data sheet. */
#define REGISTER_MOD 0
#define REGISTER_CMR 1
#define REGISTER_SR 2
#define REGISTER_IR 3
#define REGISTER_RXERR 14
#define REGISTER_TXERR 15
#define MOD_RM 0x01
/* Transmission requests, also of a frame that is to be received by its sender. */
#define CMR_TR 0x01
#define CMR_SRR 0x10
#define SR_TBS 0x04
#define SR_TCS 0x08
#define SR_ES 0x40
#define SR_BS 0x80
#define IR_RI 0x01
#define IR_TI 0x02
#define IR_EI 0x04
#define IR_EPI 0x20

#define WARNING_LIMIT 96
#define PASSIVE_LIMIT 128
#define BUS_OFF_LIMIT 256
/* What the transmit error counter holds when the chip has left the bus. */
#define COUNTER_WHEN_OFF 127

/* The beginning of the driver's private data (drivers/net/can/sja1000/sja1000.h); init() makes sure that it is this. */
struct sja1000_priv {
	struct can_priv can;
	struct sk_buff *echo_skb;
	u8 (*read_reg)(const struct sja1000_priv *priv, int reg);
	void (*write_reg)(const struct sja1000_priv *priv, int reg, u8 value);
};

irqreturn_t sja1000_interrupt(int irq, void *dev_id);

struct chip {
	struct net_device *dev;
	struct sja1000_priv *priv;
	u8 (*read_reg)(const struct sja1000_priv *priv, int reg);
	void (*write_reg)(const struct sja1000_priv *priv, int reg, u8 value);
	int transmit_errors;
	int receive_errors;
	bool is_off;
	bool is_alone;
	/* The transmission request that nobody has acknowledged yet. */
	u8 request;
	/* Interrupts that the driver has not read yet: reading them clears them. */
	u8 interrupts;
};

static struct chip chips[4];
static int chip_count;

static struct chip *chip_of(const struct sja1000_priv *priv)
{
	int i;

	for (i = 0; i < chip_count; i++)
		if (chips[i].priv == priv)
			return &chips[i];
	return NULL;
}

static int worse_counter(const struct chip *chip)
{
	return max(chip->transmit_errors, chip->receive_errors);
}

static u8 read_reg(const struct sja1000_priv *priv, int reg)
{
	struct chip *chip = chip_of(priv);
	u8 value;

	switch (reg) {
	case REGISTER_TXERR:
		return chip->transmit_errors;
	case REGISTER_RXERR:
		return chip->receive_errors;
	case REGISTER_SR:
		value = chip->read_reg(priv, reg);
		if (chip->is_off)
			value |= SR_BS | SR_ES;
		if (worse_counter(chip) >= WARNING_LIMIT)
			value |= SR_ES;
		if (chip->request)
			value &= ~(SR_TBS | SR_TCS);
		return value;
	case REGISTER_IR:
		value = chip->read_reg(priv, reg);
		/* What the emulation has sent has failed. */
		if (chip->is_off)
			value &= ~(IR_TI | IR_RI);
		value |= chip->interrupts;
		chip->interrupts = 0;
		return value;
	default:
		return chip->read_reg(priv, reg);
	}
}

static void write_reg(const struct sja1000_priv *priv, int reg, u8 value)
{
	struct chip *chip = chip_of(priv);

	if (reg == REGISTER_TXERR) {
		chip->transmit_errors = value;
	} else if (reg == REGISTER_RXERR) {
		chip->receive_errors = value;
	} else if (reg == REGISTER_MOD && !(value & MOD_RM)) {
		chip->is_off = false;
		chip->request = 0;
	} else if (reg == REGISTER_CMR && value & (CMR_TR | CMR_SRR) && chip->is_alone) {
		chip->request = value;
		return;
	}
	chip->write_reg(priv, reg, value);
}

/* Others acknowledge again, or do not any more. */
static void set_alone(struct chip *chip, bool is_alone)
{
	u8 request;

	disable_irq(chip->dev->irq);
	request = chip->request;
	chip->is_alone = is_alone;
	if (!is_alone && request) {
		chip->request = 0;
		chip->write_reg(chip->priv, REGISTER_CMR, request);
	}
	enable_irq(chip->dev->irq);
}

/* One transmission or reception more, as the driver sees it: with an interrupt where a limit is passed. */
static void count(struct chip *chip, int *counter, int step)
{
	bool was_warning = worse_counter(chip) >= WARNING_LIMIT;
	bool was_passive = worse_counter(chip) >= PASSIVE_LIMIT;
	u8 interrupts = 0;

	*counter = max(*counter + step, 0);
	if (was_warning != (worse_counter(chip) >= WARNING_LIMIT))
		interrupts |= IR_EI;
	if (was_passive != (worse_counter(chip) >= PASSIVE_LIMIT))
		interrupts |= IR_EPI;
	if (chip->transmit_errors >= BUS_OFF_LIMIT) {
		/*
		 * The frame that has failed for the last time occupies the only transmit buffer, and the driver has stopped
		 * its queue: in the reset mode the buffer's place is that of the acceptance filter.
		 */
		netif_tx_disable(chip->dev);
		chip->transmit_errors = COUNTER_WHEN_OFF;
		chip->receive_errors = 0;
		chip->is_off = true;
		chip->write_reg(chip->priv, REGISTER_MOD, MOD_RM);
		interrupts = IR_EI;
	}
	if (!interrupts)
		return;
	chip->interrupts |= interrupts;
	local_bh_disable();
	sja1000_interrupt(chip->dev->irq, chip->dev);
	local_bh_enable();
}

static int set_errors(const char *text, const struct kernel_param *parameter)
{
	char name[IFNAMSIZ], direction[16];
	struct chip *chip = NULL;
	int i, times, step, error = 0;
	int *counter;

	if (sscanf(text, "%15s %15s %d", name, direction, &times) != 3)
		return -EINVAL;
	for (i = 0; i < chip_count; i++)
		if (!strcmp(chips[i].dev->name, name))
			chip = &chips[i];
	if (!chip)
		return -ENODEV;
	if (!strcmp(direction, "alone")) {
		set_alone(chip, times > 0);
		return 0;
	}
	if (!strcmp(direction, "transmit")) {
		counter = &chip->transmit_errors;
		step = times > 0 ? 8 : -1;
	} else if (!strcmp(direction, "receive")) {
		counter = &chip->receive_errors;
		step = times > 0 ? 1 : -1;
	} else {
		return -EINVAL;
	}

	rtnl_lock();
	if (!netif_running(chip->dev)) {
		error = -ENETDOWN;
	} else {
		/* The handler must not run twice at once. */
		disable_irq(chip->dev->irq);
		for (i = 0; i < abs(times) && !chip->is_off; i++)
			count(chip, counter, step);
		enable_irq(chip->dev->irq);
	}
	rtnl_unlock();
	return error;
}

static int get_errors(char *text, const struct kernel_param *parameter)
{
	int i, length = 0;

	for (i = 0; i < chip_count; i++)
		length += scnprintf(text + length, PAGE_SIZE - length, "%s transmit %d receive %d%s\n", chips[i].dev->name,
				    chips[i].transmit_errors, chips[i].receive_errors, chips[i].is_off ? " off" : "");
	return length;
}

static const struct kernel_param_ops errors_ops = { .set = set_errors, .get = get_errors };
module_param_cb(errors, &errors_ops, NULL, 0644);
MODULE_PARM_DESC(errors, "INTERFACE transmit|receive COUNT: so many errors, or successes where it is negative; INTERFACE alone 1|0");

static bool is_ours(struct net_device *dev)
{
	struct device *parent = dev->dev.parent;

	return dev->type == ARPHRD_CAN && parent && parent->driver && !strcmp(parent->driver->name, "kvaser_pci");
}

static bool is_named(const void *function, const char *name)
{
	char symbol[KSYM_SYMBOL_LEN];

	sprint_symbol_no_offset(symbol, (unsigned long)function);
	return !strncmp(symbol, name, strlen(name));
}

static int __init init(void)
{
	struct net_device *dev;
	int error = 0;

	rtnl_lock();
	for_each_netdev(&init_net, dev) {
		struct chip *chip = &chips[chip_count];
		struct sja1000_priv *priv = netdev_priv(dev);

		if (!is_ours(dev) || chip_count == ARRAY_SIZE(chips))
			continue;
		if (!is_named(priv->read_reg, "kvaser_pci_read_reg") || !is_named(priv->write_reg, "kvaser_pci_write_reg")) {
			pr_err("error_counters: the private data of this kernel's driver are laid out in another way\n");
			error = -EINVAL;
			break;
		}
		*chip = (struct chip){ .dev = dev, .priv = priv, .read_reg = priv->read_reg, .write_reg = priv->write_reg };
		chip_count++;
	}
	if (!error && !chip_count)
		error = -ENODEV;
	if (!error) {
		int i;

		for (i = 0; i < chip_count; i++) {
			chips[i].priv->read_reg = read_reg;
			chips[i].priv->write_reg = write_reg;
		}
	}
	rtnl_unlock();
	return error;
}
/* There is no way to unload it: a handler might be in its functions. */
module_init(init);

MODULE_DESCRIPTION("Error counters for QEMU's SJA1000");
MODULE_LICENSE("GPL");
