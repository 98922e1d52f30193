/PROG  TWO_FRAMES
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "panel";
PROG_SIZE	= 612;
CREATE		= DATE 26-11-22  TIME 10:31:04;
LINE_COUNT	= 4;
DEFAULT_GROUP	= 1,*,*,*,*;
/APPL
/MN
   1:  UTOOL_NUM=1 ;
   2:  UFRAME_NUM=1 ;
   3:L P[1] 100mm/sec FINE     ;
   4:  UFRAME_NUM=2 ;
   5:L P[2] 100mm/sec FINE     ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.000  mm,	Z =       .000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[2]{
   GP1:
	UF : 2, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.000  mm,	Z =     -2.500  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
/END
