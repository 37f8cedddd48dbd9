// Which of the two transfers a program is for.

/// MLS-MPM (forces and velocity gradient through D⁻¹) instead of APIC (through kernel gradients).
override MLS: bool = true;
