/PROG  GROUPS
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "panel";
PROG_SIZE	= 612;
CREATE		= DATE 26-11-22  TIME 10:31:04;
LINE_COUNT	= 4;
DEFAULT_GROUP	= 1,*,*,*,*;
/APPL
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
   3:J P[1] 50% FINE     ;
   4:L P[2] 100mm/sec FINE     ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.000  mm,	Z =       .000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
   GP2:
	UF : 0, UT : 1,
	J1=    15.000 deg,	J2=      .000 deg
   GP3:
	UF : 0, UT : 1,
	J1=   250.000  mm
};
P[2]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    160.000  mm,	Z =       .000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
   GP2:
	UF : 0, UT : 1,
	J1=    15.000 deg,	J2=      .000 deg
   GP3:
	UF : 0, UT : 1,
	J1=   250.000  mm
};
/END
