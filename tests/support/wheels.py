"""Mechanisms of the library on wheels and blades, whose rows constrain velocities."""

import redundax as rx

MAKERS = (rx.mechanisms.skate, rx.mechanisms.rolling_disc, rx.mechanisms.cart)
